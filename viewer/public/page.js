import { open } from "./viewer.js";

open(document.body, "organ.viscera");
