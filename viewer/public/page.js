import("./viewer.js").then(
  ({ open }) => open(document.body, "organ.viscera"),
  () => {
    const sentence = document.createElement("p");
    sentence.className = "sentence";
    sentence.textContent =
      location.protocol === "file:"
        ? "This page needs a web server: a browser does not let a page that is opened from a disk load its parts. " +
          "Run python -m http.server in its folder, then open http://localhost:8000."
        : "The page cannot load viewer.js. Reload the page, or use a newer browser.";
    document.querySelector(".loading").remove();
    document.body.append(sentence);
  },
);
// What comes last: a browser runs nothing of a script that is cut.
document.querySelector(".loading").dataset.begun = "true";
