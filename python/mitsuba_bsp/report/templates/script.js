"use strict";
const root = document.documentElement, all = (selector, from = document) => [...from.querySelectorAll(selector)];

// Light and dark: the system's choice, until the button is pressed.
const theme = document.getElementById("theme"), system = matchMedia("(prefers-color-scheme: dark)");
const isDark = () => root.dataset.theme ? root.dataset.theme === "dark" : system.matches;
const tellTheme = () => theme.setAttribute("aria-pressed", isDark());
theme.addEventListener("click", () => { root.dataset.theme = isDark() ? "light" : "dark"; tellTheme(); });
system.addEventListener("change", tellTheme);
tellTheme();

// Charts are drawn when they come into view, or are printed.
function draw(chart) {
  if (chart.classList.contains("drawn")) return;
  chart.classList.add("drawn");
  const { data, layout } = JSON.parse(chart.dataset.chart);
  Plotly.newPlot(chart, data, layout, { responsive: true, displayModeBar: false });
}
const seen = new IntersectionObserver(entries => entries.forEach(entry => entry.isIntersecting && draw(entry.target)), { rootMargin: "300px" });
all(".chart").forEach(chart => seen.observe(chart));

all("img[data-picture]").forEach(image => { image.src = pictures[image.dataset.picture]; });

// What a link leads to is shown, and the contents are put away.
const contents = document.querySelector(".contents");
function reveal() {
  const target = document.getElementById(location.hash.slice(1));
  for (let outer = target; outer; outer = outer.parentElement?.closest("details")) if (outer.tagName === "DETAILS") outer.open = true;
  if (target) { if (contents) contents.open = false; target.scrollIntoView(); }
}
all("nav a, .overview a").forEach(link => link.addEventListener("click", () => setTimeout(reveal)));
addEventListener("hashchange", reveal);
reveal();

// On paper everything is drawn, explained and as wide as the paper.
const PAPER = 640;
let closed = [];
addEventListener("beforeprint", () => {
  closed = all("details:not([open])");
  closed.forEach(details => { details.open = true; });
  all(".chart").forEach(chart => { draw(chart); Plotly.relayout(chart, { autosize: false, width: PAPER }); });
});
addEventListener("afterprint", () => {
  all(".chart").forEach(chart => Plotly.relayout(chart, { autosize: true, width: null }));
  closed.forEach(details => { details.open = false; });
});

// Columns sort by their numbers in their units, or else by their words; a second press turns the order around.
const UNITS = { __proto__: null, "%": .01, k: 1e3, M: 1e6, G: 1e9, ns: 1e-9, us: 1e-6, "µs": 1e-6, ms: 1e-3, s: 1, min: 60, h: 3600, B: 1, kB: 1e3, MB: 1e6, GB: 1e9, KiB: 2 ** 10, MiB: 2 ** 20, GiB: 2 ** 30 };
function number(text) {
  const [, digits, unit] = /^[<>≤≥~±]?\s*([-+]?[\d.]+(?:e[-+]?\d+)?)\s*(%|\p{L}*)/u.exec(text.replaceAll(",", "")) ?? [];
  return parseFloat(digits) * (UNITS[unit] ?? 1);
}
all("table.sortable thead button").forEach(button => button.addEventListener("click", () => {
  const head = button.parentElement, place = head.cellIndex, table = button.closest("table"), body = table.tBodies[0];
  const rising = head.getAttribute("aria-sort") !== "ascending";
  const key = row => row.cells[place].textContent.trim();
  const compare = (a, b) => {
    const [x, y] = [number(key(a)), number(key(b))];
    if (Number.isNaN(x) !== Number.isNaN(y)) return Number.isNaN(x) ? 1 : -1;  // what is missing comes last
    const order = Number.isNaN(x) ? key(a).localeCompare(key(b)) : x - y;
    return rising ? order : -order;
  };
  [...body.rows].sort(compare).forEach(row => body.append(row));
  all("th", table.tHead).forEach(other => other.setAttribute("aria-sort", "none"));
  head.setAttribute("aria-sort", rising ? "ascending" : "descending");
}));

// Two images: divided by a line, in turns, or their difference.
all(".comparer").forEach(comparer => {
  const one = selector => comparer.querySelector(selector), specs = JSON.parse(comparer.dataset.specs);
  const stage = one(".stage"), over = one(".over"), under = one(".under"), canvas = one("canvas"), line = one(".line");
  const divide = one(".divide"), amplify = one(".amplify"), [leftName, rightName] = all(".name", stage);
  let timer = 0, asked = 0;
  const mode = () => one("input[type=radio]:checked").value;
  function split() {
    over.style.clipPath = mode() === "slider" ? `inset(0 ${100 - divide.value}% 0 0)` : "none";
    line.style.left = `${divide.value}%`;
  }
  function pixels(image) {
    canvas.width = image.naturalWidth; canvas.height = image.naturalHeight;
    const context = canvas.getContext("2d", { willReadFrequently: true });
    context.drawImage(image, 0, 0);
    return context.getImageData(0, 0, canvas.width, canvas.height);
  }
  function subtract() {
    const gain = 2 ** amplify.value, a = pixels(over), b = pixels(under);
    for (let i = 0; i < a.data.length; ++i) a.data[i] = i % 4 === 3 ? 255 : gain * Math.abs(a.data[i] - b.data[i]);
    canvas.getContext("2d").putImageData(a, 0, 0);
    comparer.querySelector("output").textContent = `${gain} times`;
  }
  async function update() {
    clearInterval(timer);
    const turn = ++asked, scene = comparer.dataset.scene, [left, right] = [one(".left").value, one(".right").value];
    over.src = pictures[specs[left]]; under.src = pictures[specs[right]];
    over.alt = `${scene}, rendered under ${left}`; under.alt = `${scene}, rendered under ${right}`;
    leftName.textContent = left; rightName.textContent = right;
    one(".same").textContent = specs[left] === specs[right] ? "In the 8 bits of these pictures the two are the same image." : "";
    await Promise.allSettled([over.decode(), under.decode()]);
    if (turn !== asked) return;  // something else was chosen meanwhile
    const now = mode();
    one(".position").hidden = line.hidden = now !== "slider";
    one(".gain").hidden = canvas.hidden = now !== "difference";
    over.hidden = under.hidden = leftName.hidden = rightName.hidden = now === "difference";
    split();
    if (now === "difference") subtract();
    if (now === "flicker") {
      const swap = () => { rightName.hidden = over.hidden; over.hidden = leftName.hidden = !over.hidden; };
      rightName.hidden = true;
      timer = setInterval(swap, 600);
    }
  }
  all("select, input[type=radio]", comparer).forEach(input => input.addEventListener("change", update));
  divide.addEventListener("input", split);
  amplify.addEventListener("input", subtract);
  const drag = event => {
    if (mode() !== "slider" || (event.type === "pointermove" && !event.buttons)) return;
    const box = stage.getBoundingClientRect();
    divide.value = 100 * (event.clientX - box.left) / box.width;
    split();
  };
  stage.addEventListener("pointerdown", drag);
  stage.addEventListener("pointermove", drag);
  all("img", stage).forEach(image => { image.draggable = false; });
  update();
});
