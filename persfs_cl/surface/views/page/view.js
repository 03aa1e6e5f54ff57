// A page of one relief and nothing else, as a notebook shows it.

const canvas = find("canvas");
const viewer = new Viewer(canvas, () => {
  find("#wear").textContent = viewer.wear === "bare" ? "Photograph" : "Bare";
});
find("#wear").addEventListener("click", () => viewer.put(viewer.wear === "bare" ? "photo" : "bare"));
find("#reset").addEventListener("click", () => viewer.look(OPENING));

function say(text) {
  find("p").textContent = text;
  find("p").hidden = false;
}

if (!viewer.able) {
  say("This browser has no WebGL, which turns the relief.");
  canvas.setAttribute("aria-busy", "false");
} else {
  viewer
    .show(JSON.parse(find("#heights").textContent))
    .catch((error) => say(`${error.message}.`))
    .finally(() => requestAnimationFrame(() => canvas.setAttribute("aria-busy", "false")));
}
