// Keeps the answers in this browser as they are given, and saves them as a CSV file. Sends nothing anywhere.

const form = document.getElementById("sheet");
const status = document.getElementById("status");
const again = document.getElementById("again");
const version = form.dataset.version;
// Pages in files share one storage: the path tells them apart.
const key = `digs-warp preference ${location.pathname}`;
const numbers = [...form.querySelectorAll("fieldset")].map((part) => part.dataset.question);
let saved = false; // as a file, since the last change

function answers() {
  const filled = new FormData(form);
  const choices = Object.fromEntries(numbers.map((n) => [n, filled.get(`question-${n}`) ?? ""]));
  return { participant: form.elements.participant.value.trim(), choices };
}

function keep() {
  try {
    localStorage.setItem(key, JSON.stringify(answers()));
    return true;
  } catch {
    return false; // switched off, or full
  }
}

function restore() {
  try {
    const { participant, choices } = JSON.parse(localStorage.getItem(key)) ?? {};
    form.elements.participant.value = participant ?? "";
    for (const n of numbers) {
      for (const input of form.elements[`question-${n}`]) input.checked = input.value === choices?.[n];
    }
  } catch {
    form.reset();
  }
}

function say(before = "") {
  const { participant, choices } = answers();
  const open = numbers.filter((n) => !choices[n]);
  const done = numbers.length - open.length;
  const missing = [
    ...(participant ? [] : ["your name or number"]),
    ...(open.length ? [`question ${open.join(", ")}`] : []),
  ];
  const left = missing.length ? ` Still open: ${missing.join("; ")}.` : "";
  status.textContent = `${before}${done} of ${numbers.length} answered.${left}`;
  again.hidden = !saved;
}

function quoted(text) {
  return /[",\r\n]/.test(text) ? `"${text.replaceAll('"', '""')}"` : text;
}

function csv({ participant, choices }) {
  const rows = numbers.map((n) => [quoted(participant), version, n, choices[n]].join(","));
  return ["participant,version,question,choice", ...rows, ""].join("\n");
}

form.addEventListener("input", () => {
  saved = false;
  say(keep() ? "" : "This browser keeps nothing: save before you close the page. ");
});

form.addEventListener("submit", (event) => {
  event.preventDefault();
  const link = document.createElement("a");
  const name = answers().participant.replace(/[^\p{L}\p{N}_-]+/gu, "-").slice(0, 40);
  link.href = URL.createObjectURL(new Blob([csv(answers())], { type: "text/csv" }));
  link.download = `answers-version-${version}-${name}.csv`;
  link.click();
  setTimeout(() => URL.revokeObjectURL(link.href), 10000);
  saved = true;
  say(`Saved as ${link.download}: hand that file in. `);
});

again.addEventListener("click", () => {
  localStorage.removeItem(key);
  form.reset();
  saved = false;
  say();
  form.elements.participant.focus();
});

window.addEventListener("beforeunload", (event) => {
  const { participant, choices } = answers();
  const isEmpty = !participant && !Object.values(choices).some(Boolean);
  if (!saved && !isEmpty && !keep()) event.preventDefault();
});

restore();
say();
