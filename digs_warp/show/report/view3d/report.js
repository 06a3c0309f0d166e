// The page of a report: its view, parts that open by a link, pictures that open large, text to copy.

begin(async (stage) =>
  Uint8Array.from(atob(document.getElementById(stage.data).textContent), (letter) => letter.charCodeAt(0)),
);

function open() {
  for (let at = document.getElementById(location.hash.slice(1)); at; at = at.parentElement) {
    if (at.tagName === "DETAILS") at.open = true;
  }
  document.getElementById(location.hash.slice(1))?.scrollIntoView();
}
addEventListener("hashchange", open);
if (location.hash) open();

const copy = document.querySelector("button[name=copy]");
copy.addEventListener("click", async () => {
  const text = document.querySelector("#settings pre");
  try {
    await navigator.clipboard.writeText(text.textContent);
    copy.textContent = "Copied";
  } catch {
    getSelection().selectAllChildren(text); // a page from a file may not write to the clipboard
  }
});

// A click on a picture of a table shows it as large as the window; arrow keys go to its neighbors.
const large = document.body.appendChild(document.createElement("dialog"));
const [shown, caption] = ["img", "p"].map((tag) => large.appendChild(document.createElement(tag)));
let pictures = [];
let number = 0;
const show = (next) => {
  number = (next + pictures.length) % pictures.length;
  shown.src = pictures[number].src;
  caption.textContent = `${pictures[number].alt}. Arrow keys: the others. Escape: back.`;
};
document.addEventListener("click", ({ target }) => {
  if (target.closest("dialog")) large.close();
  if (!target.matches("table.pictures img")) return;
  pictures = [...target.closest("table").querySelectorAll("img")];
  show(pictures.indexOf(target));
  large.showModal();
});
large.addEventListener("keydown", ({ key }) => {
  const step = { ArrowRight: 1, ArrowLeft: -1 }[key];
  if (step) show(number + step);
});
