// The view of one or several contents: what is loaded, where it stands, and when it is drawn.

const MOST_PIXELS_PER_PIXEL = 2;

// Without a graphics card, a view that moves is drawn coarser: where one took longer than this [ms].
const SLOW = 60;
const COARSE = 0.4;
const REST = 250; // until it counts as still [ms]

const LIGHT = [1, 1, 1];
const DARK = [0.071, 0.086, 0.11];
const SPACING = 2.2; // of contents side by side, in radii
const NEAR_CLICK = 14; // of a camera [px]

class Viewer {
  // place: holds the canvas; contents: as view3d/contents.py describes them; load: returns the bytes of a stage.
  constructor(place, contents, load) {
    this.place = place;
    this.contents = contents;
    this.load = load;
    this.canvas = place.querySelector("canvas");
    this.note = place.querySelector(".note");
    // What is shown: layers by name, one of the contents or all, the stage (0: first, 1: last), a box or null.
    const layers = contents.flatMap((each) => each.layers);
    this.shows = Object.fromEntries(layers.map((layer) => [layer.name, layer.shown]));
    this.cameras = false;
    this.alone = null;
    this.stage = 1;
    this.box = null;
    this.shown = 0;
    this.taken = () => {}; // called with the content and the name of a camera that the view goes to
    this.drawing = new Drawing(this.canvas);
    this.orbit = new Orbit(this.start());
    this.waiting = this.slow = false;
    this.rest = 0;
    listen(this.canvas, place, this.orbit, () => this.redraw());
    this.canvas.addEventListener("click", (event) => this.pick(event));
    this.dark = matchMedia("(prefers-color-scheme: dark)");
    this.dark.addEventListener("change", () => this.redraw());
    new ResizeObserver(() => this.redraw()).observe(this.canvas);
    this.canvas.addEventListener("webglcontextlost", () => {
      place.classList.remove("live");
      this.note.textContent = "The graphics card gave up: this is a picture. Load the page again.";
    });
  }

  chosen() {
    return this.alone === null ? this.contents : [this.contents[this.alone]];
  }

  // Where the view begins: that of the first, farther away if several stand side by side.
  start() {
    const [first, ...others] = this.chosen();
    const away = add(first.start.eye, first.start.target, -1);
    return { ...first.start, eye: add(first.start.target, away, 1 + 0.8 * others.length) };
  }

  // Where a content stands: the first ones in their world, the others beside it.
  offset(content) {
    const chosen = this.chosen();
    const radius = ({ start }) => Math.hypot(...add(start.eye, start.target, -1)) * start.halfView;
    const wide = SPACING * Math.max(...chosen.map(radius));
    const across = wide * (chosen.indexOf(content) - (chosen.length - 1) / 2);
    const right = new Orbit(chosen[0].start).pose().axes[0];
    return add(add(chosen[0].start.target, content.start.target, -1), right, across);
  }

  stageOf(layer) {
    return layer.stages[Math.round(this.stage * (layer.stages.length - 1))];
  }

  // Loads and draws what is chosen.
  async update() {
    const parts = [];
    for (const content of this.chosen()) {
      for (const layer of content.layers.filter(({ name }) => this.shows[name])) {
        const stage = this.stageOf(layer);
        stage.splats ??= unpack(await this.load(stage), stage);
        const box = layer.name === "gaussians" ? this.box : null;
        parts.push({ splats: stage.splats, offset: this.offset(content), box });
      }
    }
    const lines = this.chosen().flatMap((each) => (each.cameras ? cameraLines(each.cameras, this.offset(each)) : []));
    this.drawing.load(merged(parts), lines);
    this.place.classList.add("live");
    this.redraw();
  }

  draw(detail) {
    fit(this.canvas, detail);
    const start = performance.now();
    const paper = this.dark.matches ? DARK : LIGHT;
    this.canvas.dataset.drawn = this.drawing.draw(this.orbit, this.cameras, this.shown, paper);
    if (detail === 1) this.slow = performance.now() - start > SLOW;
    this.canvas.dataset.detail = detail;
  }

  redraw() {
    if (this.waiting || !this.drawing.order) return;
    this.waiting = true;
    requestAnimationFrame(() => {
      this.waiting = false;
      this.draw(this.slow ? COARSE : 1);
      clearTimeout(this.rest);
      if (this.slow) this.rest = setTimeout(() => this.draw(1), REST);
    });
  }

  showCameras(shown) {
    this.cameras = shown;
    this.orbit.reset();
    if (shown) this.orbit.zoom(Math.max(1, ...this.chosen().map(({ cameras }) => cameras?.zoom ?? 1)));
    this.redraw();
  }

  // Goes to the camera that was clicked, if it is shown.
  pick(event) {
    if (!this.cameras) return;
    const { eye, axes } = this.orbit.pose();
    const [width, height] = [this.canvas.clientWidth, this.canvas.clientHeight];
    const focal = this.orbit.focal(width, height);
    let [least, found] = [NEAR_CLICK, null];
    for (const content of this.chosen().filter(({ cameras }) => cameras)) {
      for (const camera of content.cameras.list) {
        const place = add(camera.eye, this.offset(content));
        const [x, y, z] = axes.map((axis) => dot(add(place, eye, -1), axis));
        const px = [width / 2 + (focal * x) / z - event.offsetX, height / 2 + (focal * y) / z - event.offsetY];
        if (z > 0 && Math.hypot(...px) < least) [least, found] = [Math.hypot(...px), [content, camera, place]];
      }
    }
    if (!found) return;
    const [content, camera, place] = found;
    this.orbit.take({ ...camera, eye: place }, content.cameras, width, height);
    this.cameras = false;
    this.taken(content, camera.name);
    this.redraw();
  }
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

// Puts a view in the place of its picture; the picture stays where WebGL 2 is missing. Returns null there.
function begin(load) {
  const place = document.getElementById("view3d");
  const about = JSON.parse(document.getElementById("view3d-about").textContent);
  const note = place.querySelector(".note");
  const fail = (error) => {
    place.classList.remove("live");
    const rest = place.querySelector(".stage > img:not(.photo)") ? ": this is a picture." : ".";
    note.textContent = `This browser cannot draw it (${error.message})${rest}`;
  };
  let viewer;
  try {
    viewer = new Viewer(place, about.contents, load);
  } catch (error) {
    fail(error);
    return null;
  }
  const cameras = place.querySelector("input[name=cameras]");
  cameras?.addEventListener("change", () => viewer.showCameras(cameras.checked));
  viewer.taken = () => (cameras.checked = false);
  const full = place.querySelector("button[name=full]");
  full.addEventListener("click", () =>
    document.fullscreenElement ? document.exitFullscreen() : place.requestFullscreen(),
  );
  viewer.update().then(
    () => (note.textContent = about.help),
    fail,
  );
  return viewer;
}
