"use strict";
// Names come into the page as text only (textContent), never as markup.

function theme() {
  const button = document.createElement("button");
  const dark = matchMedia("(prefers-color-scheme: dark)");
  const root = document.documentElement;
  const isDark = () => (root.dataset.theme || (dark.matches ? "dark" : "light")) === "dark";
  const label = () => { button.textContent = isDark() ? "light" : "dark"; };
  button.id = "theme";
  button.className = "tool";
  button.type = "button";
  button.title = "switch between light and dark";
  button.addEventListener("click", () => { root.dataset.theme = isDark() ? "light" : "dark"; label(); });
  dark.addEventListener("change", label);
  label();
  document.querySelector("header").prepend(button);
}

function valueOf(cell) {
  const text = cell.textContent.trim();
  if (text === "" || text === "–") return null;
  const number = Number(text.replace("−", "-"));
  return Number.isNaN(number) ? text : number;
}

function compare(a, b) {
  if (typeof a === "number" && typeof b === "number") return a - b;
  if (typeof a !== typeof b) return typeof a === "number" ? -1 : 1;
  return a.localeCompare(b, undefined, { numeric: true });
}

function sortable(table) {
  const body = table.tBodies[0];
  const original = Array.from(body.rows);
  Array.from(table.tHead.rows[0].cells).forEach((head, column) => {
    const button = document.createElement("button");
    button.type = "button";
    button.append(...head.childNodes);
    head.append(button);
    button.addEventListener("click", () => {
      const next = { none: "descending", descending: "ascending", ascending: "none" };
      const texts = !head.classList.contains("n");
      const now = head.getAttribute("aria-sort") || "none";
      let order = next[now];
      if (texts) order = { none: "ascending", ascending: "descending", descending: "none" }[now];
      for (const other of table.tHead.rows[0].cells) other.removeAttribute("aria-sort");
      let rows = original.slice();
      if (order !== "none") {
        head.setAttribute("aria-sort", order);
        const sign = order === "ascending" ? 1 : -1;
        const keyed = rows.map((row) => [valueOf(row.cells[column]), row]);
        // what is not known stands last either way
        keyed.sort(([a], [b]) => (a === null || b === null ? (a === null) - (b === null) : sign * compare(a, b)));
        rows = keyed.map(([, row]) => row);
      }
      body.append(...rows);
    });
  });
}

function filterable(table, holder) {
  const line = document.createElement("label");
  const field = document.createElement("input");
  const count = document.createElement("span");
  const rows = Array.from(table.tBodies[0].rows);
  line.className = "filter";
  field.type = "search";
  field.placeholder = "filter";
  field.setAttribute("aria-label", "filter the rows of the table below");
  field.addEventListener("input", () => {
    const words = field.value.toLowerCase().split(/\s+/).filter(Boolean);
    let shown = 0;
    for (const row of rows) {
      const text = row.textContent.toLowerCase();
      row.hidden = !words.every((word) => text.includes(word));
      shown += row.hidden ? 0 : 1;
    }
    count.textContent = words.length ? shown + " of " + rows.length + " rows" : "";
  });
  line.append(field, count);
  holder.before(line);
}

function tables() {
  for (const table of document.querySelectorAll("table.list")) {
    sortable(table);
    if (table.tBodies[0].rows.length > 8) filterable(table, table.parentElement);
  }
}

function unfoldForPrint() {
  const short = (fold) => fold.querySelectorAll("tbody tr").length <= 60;
  const folded = () => Array.from(document.querySelectorAll("details:not([open])")).filter(short);
  let opened = [];
  addEventListener("beforeprint", () => { opened = folded(); opened.forEach((d) => { d.open = true; }); });
  addEventListener("afterprint", () => { opened.forEach((d) => { d.open = false; }); });
}

function plan() {
  const box = document.querySelector(".plan");
  if (!box) return;
  const svg = box.querySelector("svg.map");
  const said = box.querySelector("output");
  const chosen = svg.querySelector(".chosen");
  const ring = svg.querySelector(".ring");
  const spots = JSON.parse(document.getElementById("plan-data").textContent);
  const whole = svg.viewBox.baseVal;
  const full = { x: whole.x, y: whole.y, w: whole.width, h: whole.height };
  let view = { ...full };
  let drag = null;

  const unit = () => view.w / Math.max(svg.clientWidth, 1);
  function draw() {
    svg.setAttribute("viewBox", [view.x, view.y, view.w, view.h].join(" "));
    svg.style.setProperty("--u", unit());
    scaleBar();
  }
  function scaleBar() {
    const target = 0.2 * view.w;
    const power = 10 ** Math.floor(Math.log10(target));
    const size = [5, 2, 1].find((step) => step * power <= target) * power;
    box.querySelector(".length").setAttribute("width", (100 * size) / view.w);
    box.querySelector(".length-text").textContent =
      size >= 1000 ? size / 1000 + " km" : size >= 1 ? size + " m" : Math.round(size * 1000) + " mm";
  }
  function place(event) {
    const frame = svg.getBoundingClientRect();
    return [view.x + ((event.clientX - frame.left) / frame.width) * view.w,
            view.y + ((event.clientY - frame.top) / frame.height) * view.h];
  }
  function zoom(factor, x, y) {
    const w = Math.min(Math.max(view.w * factor, full.w / 400), full.w);
    const f = w / view.w;
    view = { x: x - (x - view.x) * f, y: y - (y - view.y) * f, w: w, h: view.h * f };
    keep();
    draw();
  }
  function keep() {
    view.x = Math.min(Math.max(view.x, full.x), full.x + full.w - view.w);
    view.y = Math.min(Math.max(view.y, full.y), full.y + full.h - view.h);
  }
  function answer(x, y) {
    let best = null;
    let least = 14 * unit();
    for (const spot of spots) {
      const distance = Math.hypot(spot[1] - x, spot[2] - y);
      if (distance < least) { least = distance; best = spot; }
    }
    ring.setAttribute("visibility", best ? "visible" : "hidden");
    chosen.setAttribute("d", "");
    if (!best) { said.textContent = said.dataset.hint; return; }
    ring.setAttribute("transform", "translate(" + best[1] + "," + best[2] + ")");
    if (best[5].length) {
      const corners = [];
      for (let k = 0; k < best[5].length; k += 2) corners.push(best[5][k] + "," + best[5][k + 1]);
      chosen.setAttribute("d", "M" + corners.join("L") + "Z");
    }
    const name = document.createElement("b");
    name.textContent = best[3];
    said.replaceChildren(best[0] + " ", name, ": " + best[4]);
  }
  svg.addEventListener("wheel", (event) => {
    // before a click the wheel belongs to the page
    if (!event.ctrlKey && document.activeElement !== svg) return;
    event.preventDefault();
    zoom(event.deltaY > 0 ? 1.25 : 0.8, ...place(event));
  }, { passive: false });
  svg.addEventListener("pointerdown", (event) => {
    drag = { x: event.clientX, y: event.clientY, from: { ...view } };
    svg.setPointerCapture(event.pointerId);
    svg.focus({ preventScroll: true });
  });
  svg.addEventListener("pointermove", (event) => {
    if (drag) {
      view.x = drag.from.x - (event.clientX - drag.x) * unit();
      view.y = drag.from.y - (event.clientY - drag.y) * unit();
      keep();
      draw();
    }
    answer(...place(event));
  });
  for (const name of ["pointerup", "pointercancel"]) svg.addEventListener(name, () => { drag = null; });
  svg.addEventListener("dblclick", (event) => zoom(0.4, ...place(event)));
  const middle = () => [view.x + view.w / 2, view.y + view.h / 2];
  const step = { ArrowLeft: [-1, 0], ArrowRight: [1, 0], ArrowUp: [0, -1], ArrowDown: [0, 1] };
  svg.addEventListener("keydown", (event) => {
    if (event.key === "+") zoom(0.6, ...middle());
    else if (event.key === "-") zoom(1 / 0.6, ...middle());
    else if (step[event.key]) {
      view.x += 0.15 * view.w * step[event.key][0];
      view.y += 0.15 * view.h * step[event.key][1];
      keep();
      draw();
    } else return;
    event.preventDefault();
  });
  const actions = { "+": () => zoom(0.6, ...middle()), "−": () => zoom(1 / 0.6, ...middle()),
                    "whole block": () => { view = { ...full }; draw(); } };
  for (const [label, action] of Object.entries(actions)) {
    const button = document.createElement("button");
    button.type = "button";
    button.className = "tool";
    button.textContent = label;
    button.addEventListener("click", action);
    box.querySelector(".tools").append(button);
  }
  said.dataset.hint = "Point at a photograph or point for its numbers. + and −, or the wheel after a click, zoom; drag moves.";
  said.textContent = said.dataset.hint;
  addEventListener("resize", draw);
  addEventListener("beforeprint", () => { view = { ...full }; draw(); });
  draw();
}

theme();
tables();
unfoldForPrint();
plan();
