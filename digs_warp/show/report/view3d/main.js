// Puts the view in the place of its picture; the picture stays where WebGL 2 is missing.

const MOST_PIXELS_PER_PIXEL = 2;

// Without a graphics card, a view that moves is drawn coarser: where one took longer than this [ms].
const SLOW = 60;
const COARSE = 0.4;
const REST = 250; // until it counts as still [ms]

function start(place) {
  const about = JSON.parse(document.getElementById("view3d-about").textContent);
  const canvas = place.querySelector("canvas");
  const tools = place.querySelector(".tools");
  const note = place.querySelector(".note");
  const cameras = tools.querySelector("input");
  const orbit = new Orbit(about.start);
  let drawing;
  try {
    const splats = unpack(document.getElementById("view3d-splats").textContent, about.splats);
    drawing = new Drawing(canvas, splats, about.splats, cameraLines(about.cameras));
  } catch (error) {
    note.textContent = `This browser cannot draw it (${error.message}): this is a picture.`;
    return;
  }
  place.classList.add("live");
  note.textContent = about.help;
  let waiting = false;
  let slow = false;
  let rest = 0;
  const draw = (detail) => {
    fit(canvas, detail);
    const start = performance.now();
    canvas.dataset.drawn = drawing.draw(orbit, cameras.checked);
    if (detail === 1) slow = performance.now() - start > SLOW;
    canvas.dataset.detail = detail;
  };
  const redraw = () => {
    if (waiting) return;
    waiting = true;
    requestAnimationFrame(() => {
      waiting = false;
      draw(slow ? COARSE : 1);
      clearTimeout(rest);
      if (slow) rest = setTimeout(() => draw(1), REST);
    });
  };
  listen(canvas, tools, orbit, redraw);
  cameras.addEventListener("change", () => {
    orbit.reset();
    if (cameras.checked) orbit.zoom(about.cameras.zoom);
    redraw();
  });
  new ResizeObserver(redraw).observe(canvas);
  canvas.addEventListener("webglcontextlost", () => {
    place.classList.remove("live");
    note.textContent = "The graphics card gave up: this is a picture. Load the page again.";
  });
  redraw();
}

// Gives the canvas as many pixels as it has on the screen, or a share of them to either side.
function fit(canvas, detail) {
  const scale = detail * Math.min(MOST_PIXELS_PER_PIXEL, window.devicePixelRatio || 1);
  const [width, height] = [canvas.clientWidth, canvas.clientHeight].map((side) =>
    Math.max(1, Math.round(scale * side)),
  );
  if (canvas.width !== width) canvas.width = width;
  if (canvas.height !== height) canvas.height = height;
}

start(document.getElementById("view3d"));
