// Steps of colour for |w| and sigma, the same in the plan and in the photograph.

export const STEPS = ["#4575b4", "#74add1", "#a6bd6b", "#f0b040", "#f46d43", "#b3001b"];
export const UNKNOWN = "#9aa3ad";
const W_LIMITS = [1, 2, 3, 4, 6];

export function colourOfW(w) {
  return w === null || w === undefined ? UNKNOWN : STEPS[stepOf(Math.abs(w), W_LIMITS)];
}

export function stepOf(value, limits) {
  let step = 0;
  while (step < limits.length && value >= limits[step]) step++;
  return step;
}

export function limitsOfW() { return W_LIMITS; }

// Limits between which a sixth of the values lie each.
export function sixths(values) {
  const known = values.filter(value => value !== null).sort((a, b) => a - b);
  return [1, 2, 3, 4, 5].map(k => known.length ? known[Math.floor(k * known.length / 6)] : k);
}
