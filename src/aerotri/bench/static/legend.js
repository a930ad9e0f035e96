// What the colours and lengths of the plan mean: steps of colour, how large differences are drawn, a scale bar.

import { make } from "./dom.js";
import { STEPS } from "./colours.js";

const LONGEST_PX = 110;

// 1, 2 or 5 times a power of ten, at most as given.
export function roundLength(most) {
  const power = 10 ** Math.floor(Math.log10(most));
  return [5, 2, 1].find(step => step * power <= most * (1 + 1e-9)) * power;
}

export function metres(value) {
  const text = number => String(+number.toPrecision(3));
  if (value >= 1000) return `${text(value / 1000)} km`;
  if (value >= 1) return `${text(value)} m`;
  return value >= 0.01 ? `${text(100 * value)} cm` : `${text(1000 * value)} mm`;
}

// Steps of the points' colours in words.
export function showColours(plan) {
  const place = document.getElementById("legend"), limits = plan.limits[plan.by];
  const text = plan.by === "w" ? value => String(value) : metres;
  const words = [`below ${text(limits[0])}`, ...limits.slice(1).map((limit, k) => `${text(limits[k])} – ${text(limit)}`), `${text(limits[limits.length - 1])} and more`];
  const keys = words.map((word, k) => { const key = make("i"); key.style.background = STEPS[k]; return make("span", {}, key, word); });
  place.replaceChildren(make("b", {}, plan.by === "w" ? "points: largest |w| of their rays" : "points: σ in space"), ...keys);
  place.hidden = !plan.show.points;
}

// Pixels that the bars at the lower edge take.
export const BARS_PX = 60;

// Bars of the plan; north is up.
export function drawBars(pen, plan) {
  const { scale, height } = plan.surface, bars = [];
  bars.push(["#111", scale, "north is up"]);
  if (plan.show.vectors && plan.content.control.point.length) {
    bars.push(["#b3001b", scale * plan.times.vectors * plan.factor.vectors, "difference in plan"], ["#0b63b8", scale * plan.times.vectors * plan.factor.vectors, "difference in height"]);
  }
  if (plan.show.ellipses && plan.ellipses) bars.push(["#5a2d82", scale * plan.ellipses.k * plan.factor.ellipses, "σ, semi-axes of ellipses"]);
  stack(pen, height, bars, metres);
}

// Bars of a photograph: a length in it, and how long a residual is drawn.
export function drawPhotoBars(pen, photo) {
  const { scale, height } = photo.surface, bars = [["#ffffff", scale, "in the photograph"]];
  if (photo.show.marks && photo.show.residuals) bars.push(["#ff8f7a", scale * photo.times, "residual"]);
  stack(pen, height, bars, value => `${+value.toPrecision(3)} px`, "#ffffff", "#000000c0");
}

// Bars over one another in the lower left corner: colour, pixels of a unit, what it is; in words how much it is.
function stack(pen, height, bars, inWords, ink = "#111", edge = "#ffffffe0") {
  pen.font = "12px system-ui, sans-serif";
  bars.reverse().forEach(([colour, pixels, words], k) => {
    const length = roundLength(LONGEST_PX / pixels), y = height - 12 - 17 * k, end = 10 + length * pixels;
    pen.beginPath();
    pen.moveTo(10, y - 4); pen.lineTo(10, y); pen.lineTo(end, y); pen.lineTo(end, y - 4);
    for (const [tone, wide] of [[edge, 5], [colour, 2]]) {
      pen.strokeStyle = tone;
      pen.lineWidth = wide;
      pen.stroke();
    }
    pen.strokeStyle = edge;
    pen.lineWidth = 4;
    pen.strokeText(`${inWords(length)}, ${words}`, end + 6, y + 1);
    pen.fillStyle = ink;
    pen.fillText(`${inWords(length)}, ${words}`, end + 6, y + 1);
  });
}
