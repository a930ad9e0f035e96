// How measured and predicted places are drawn, in the photograph and in the cut-outs.

export function cross(pen, x, y, size, colour, width = 1.5) {
  pen.beginPath();
  pen.moveTo(x - size, y); pen.lineTo(x - size / 4, y); pen.moveTo(x + size / 4, y); pen.lineTo(x + size, y);
  pen.moveTo(x, y - size); pen.lineTo(x, y - size / 4); pen.moveTo(x, y + size / 4); pen.lineTo(x, y + size);
  edged(pen, colour, width);
}

export function ring(pen, x, y, radius, colour, width = 1.5) {
  pen.beginPath();
  pen.arc(x, y, radius, 0, 7);
  edged(pen, colour, width);
}

export function line(pen, points, colour, width = 1.5) {
  pen.beginPath();
  points.forEach(([x, y], k) => { if (k) pen.lineTo(x, y); else pen.moveTo(x, y); });
  edged(pen, colour, width);
}

// A dark edge, so that a mark is seen on bright and on dark ground.
function edged(pen, colour, width) {
  pen.strokeStyle = "#000000a0";
  pen.lineWidth = width + 2;
  pen.stroke();
  pen.strokeStyle = colour;
  pen.lineWidth = width;
  pen.stroke();
}

export function label(pen, text, x, y, colour) {
  pen.font = "12px system-ui, sans-serif";
  pen.lineWidth = 3;
  pen.strokeStyle = "#000000b0";
  pen.strokeText(text, x, y);
  pen.fillStyle = colour;
  pen.fillText(text, x, y);
}
