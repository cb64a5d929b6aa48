import("./viewer.js").then(
  ({ open }) => open(document.body, "organ.viscera"),
  () => {
    const sentence = document.createElement("p");
    sentence.className = "sentence";
    sentence.textContent =
      location.protocol === "file:"
        ? "This page has to come from a web server; opened as a file, a browser does not let it load its parts. " +
          "In its folder, run python -m http.server and open http://localhost:8000."
        : "The page cannot load viewer.js: load the page again, or use a newer browser.";
    document.body.append(sentence);
  },
);
