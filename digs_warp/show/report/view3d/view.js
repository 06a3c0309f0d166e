// The page of `digs-warp view`: the switches beside the view, and what they change.

const about = JSON.parse(document.getElementById("view3d-about").textContent);
const place = document.getElementById("view3d");
const panel = place.querySelector(".panel");
const photo = place.querySelector(".photo");

const make = (kind, values, ...inside) => {
  const made = Object.assign(document.createElement(kind), values);
  made.append(...inside);
  return made;
};
const capital = (name) => name[0].toUpperCase() + name.slice(1);
const labeled = (text, input) => {
  panel.append(make("label", {}, text, input));
  return input;
};
const choice = (text, names) => labeled(text, make("select", {}, ...names.map((name, value) => make("option", { value }, name))));

about.contents.forEach((content, number) => {
  const title = about.contents.length > 1 ? `${number + 1}: ${content.name}` : content.name;
  panel.append(make("h2", {}, title), ...content.facts.map((fact) => make("p", {}, fact)));
});
if (about.contents.some((content) => content.cameras)) {
  labeled("Cameras", make("input", { type: "checkbox", name: "cameras" }));
}

const viewer = begin(async (stage) => {
  const answer = await fetch(stage.url, { cache: "no-store" });
  Object.assign(stage, JSON.parse(answer.headers.get("X-About")));
  return new Uint8Array(await answer.arrayBuffer());
});
if (viewer) connect();

function connect() {
  if (about.contents.length > 1) {
    const names = about.contents.map((content, number) => `${number + 1}: ${content.name}`);
    const standing = choice("Compare", ["side by side", ...names]);
    standing.addEventListener("change", () => {
      viewer.alone = +standing.value ? standing.value - 1 : null;
      viewer.orbit.begin(viewer.start());
      viewer.update();
    });
  }
  for (const name of Object.keys(viewer.shows)) {
    const box = labeled(capital(name), make("input", { type: "checkbox", checked: viewer.shows[name], name }));
    box.addEventListener("change", () => {
      viewer.shows[name] = box.checked;
      viewer.update();
    });
  }
  const trained = about.contents.filter((content) => content.layers.some(({ name }) => name === "gaussians"));
  if (trained.length) connectTraining(trained);
  const kinds = [...new Set(about.contents.flatMap(({ pictures }) => pictures))];
  if (kinds.length) connectPictures(kinds);
  if (trained.length) connectCrop(trained[0]);
}

function connectTraining(trained) {
  const layers = trained.map((content) => content.layers.find(({ name }) => name === "gaussians"));
  const most = Math.max(...layers.map(({ stages }) => stages.length));
  if (most > 1) {
    const slider = labeled("Training", make("input", { type: "range", min: 0, max: 1, step: 1 / (most - 1), value: 1 }));
    const label = panel.appendChild(make("p", {}));
    slider.addEventListener("input", () => {
      viewer.stage = +slider.value;
      label.textContent = [...new Set(layers.map((layer) => viewer.stageOf(layer).label))].join(", ");
      viewer.update();
    });
  }
  const drawn = choice("Drawn", SHOWN);
  drawn.addEventListener("change", () => {
    viewer.shown = +drawn.value;
    viewer.redraw();
  });
}

// A click on a camera goes there and shows its picture in the corner; a click on that lays it over the view.
function connectPictures(kinds) {
  const kind = choice("Cameras show", [...kinds, "nothing"]);
  let taken = null;
  const show = () => {
    photo.hidden = !taken || +kind.value === kinds.length;
    if (!photo.hidden) photo.src = `picture/${taken.join("/")}/${kinds[kind.value]}`;
  };
  const forget = () => {
    taken = null;
    show();
  };
  kind.addEventListener("change", show);
  photo.addEventListener("error", () => (photo.hidden = true));
  photo.addEventListener("click", () => photo.classList.toggle("over"));
  viewer.taken = (content, name) => {
    place.querySelector("input[name=cameras]").checked = false;
    taken = [viewer.contents.indexOf(content), name];
    show();
  };
  viewer.canvas.addEventListener("pointerdown", forget);
  viewer.canvas.addEventListener("keydown", forget);
}

function connectCrop(content) {
  const corners = content.box.map((corner) => corner.map((value) => make("input", { type: "number", value: value.toFixed(3), step: 0.01 })));
  const cuts = make("input", { type: "checkbox" });
  const said = make("p", {});
  const box = () => (cuts.checked ? corners.map((corner) => corner.map((input) => +input.value)) : null);
  const change = () => {
    viewer.box = box();
    const numbers = corners.flat().map((input) => input.value).join(" ");
    said.textContent = cuts.checked ? `digs-warp edit ${content.name} --keep-box ${numbers} --out cropped.usdz` : "";
    viewer.update();
  };
  for (const input of [cuts, ...corners.flat()]) input.addEventListener("change", change);
  const rows = ["Lowest x, y, z [m]", "Highest x, y, z [m]"].flatMap((text, row) => [make("p", {}, text), ...corners[row]]);
  const cut = make("label", {}, "Crop to the box", cuts);
  panel.append(make("details", {}, make("summary", {}, "Crop"), cut, ...rows, said));
}
