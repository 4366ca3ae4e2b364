// Starts the viewer on the page's scene. Without WebGL 2 the still picture stays.

const root = document.getElementById("viewer");
if (root) {
  const scene = JSON.parse(document.getElementById("scene").textContent);
  try {
    const viewer = new Viewer(root, scene);
    // For the browser's console, and scripts/browser-test.mjs.
    root.viewer = viewer;
    root.classList.add("started");
    if (scene.live) new Live(viewer, scene.live);
  } catch (error) {
    root.querySelector("[data-viewer=note]").textContent = `No 3D view: ${error.message}.`;
  }
}
