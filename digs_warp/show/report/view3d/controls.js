// Mouse, touch, keyboard and buttons turn the orbit; `changed` is called after each.

const STEP = (5 * Math.PI) / 180;
const ZOOM_STEP = 1.15;
const FULL_TURN = 1.2 * Math.PI; // for a drag across the whole view

function listen(canvas, tools, orbit, changed) {
  const actions = {
    ArrowLeft: () => orbit.turn(-STEP, 0),
    ArrowRight: () => orbit.turn(STEP, 0),
    ArrowUp: () => orbit.turn(0, STEP),
    ArrowDown: () => orbit.turn(0, -STEP),
    "+": () => orbit.zoom(1 / ZOOM_STEP),
    "=": () => orbit.zoom(1 / ZOOM_STEP),
    "-": () => orbit.zoom(ZOOM_STEP),
    0: () => orbit.reset(),
  };
  const shifted = {
    ArrowLeft: () => orbit.pan(0.05, 0),
    ArrowRight: () => orbit.pan(-0.05, 0),
    ArrowUp: () => orbit.pan(0, 0.05),
    ArrowDown: () => orbit.pan(0, -0.05),
  };
  canvas.addEventListener("keydown", (event) => {
    if (event.ctrlKey || event.metaKey || event.altKey) return;
    const act = (event.shiftKey && shifted[event.key]) || actions[event.key];
    if (!act) return;
    event.preventDefault();
    act();
    changed();
  });
  // A wheel scrolls the page until the view has the focus.
  canvas.addEventListener(
    "wheel",
    (event) => {
      if (document.activeElement !== canvas) return;
      event.preventDefault();
      orbit.zoom(Math.exp(0.001 * event.deltaY * (event.deltaMode ? 30 : 1)));
      changed();
    },
    { passive: false },
  );
  listenToPointers(canvas, orbit, changed);
  for (const button of tools.querySelectorAll("button[data-key]")) {
    button.addEventListener("click", () => {
      actions[button.dataset.key]();
      changed();
    });
  }
}

// One finger or button turns; two fingers, or Shift or another button, move and zoom.
function listenToPointers(canvas, orbit, changed) {
  const held = new Map();
  const middle = () => {
    const all = [...held.values()];
    return [0, 1].map((i) => all.reduce((sum, at) => sum + at[i], 0) / all.length);
  };
  const spread = () => {
    const [a, b] = [...held.values()];
    return b ? Math.hypot(a[0] - b[0], a[1] - b[1]) : 0;
  };
  canvas.addEventListener("pointerdown", (event) => {
    canvas.setPointerCapture(event.pointerId);
    held.set(event.pointerId, [event.clientX, event.clientY]);
    canvas.focus({ preventScroll: true });
  });
  canvas.addEventListener("pointermove", (event) => {
    if (!held.has(event.pointerId)) return;
    const [before, wide] = [middle(), spread()];
    held.set(event.pointerId, [event.clientX, event.clientY]);
    const moved = add(middle(), before, -1);
    const side = Math.min(canvas.clientWidth, canvas.clientHeight);
    if (held.size > 1 || event.shiftKey || event.buttons > 1) {
      orbit.pan(moved[0] / side, moved[1] / side);
      if (wide > 0 && spread() > 0) orbit.zoom(wide / spread());
    } else {
      orbit.turn((-FULL_TURN * moved[0]) / side, (FULL_TURN * moved[1]) / side);
    }
    changed();
  });
  for (const end of ["pointerup", "pointercancel", "lostpointercapture"]) {
    canvas.addEventListener(end, (event) => held.delete(event.pointerId));
  }
  canvas.addEventListener("contextmenu", (event) => event.preventDefault());
}
