// Small helpers to make elements. Names of files are text here, never markup.

export function make(tag, properties = {}, ...children) {
  const element = document.createElement(tag);
  for (const [name, value] of Object.entries(properties)) {
    if (name === "class") element.className = value;
    else if (name.startsWith("on")) element.addEventListener(name.slice(2), value);
    else if (name in element && name !== "list") element[name] = value;
    else element.setAttribute(name, value);
  }
  element.append(...children.map(child => child ?? ""));
  return element;
}

export function button(text, action, title = "") {
  return make("button", { type: "button", title, onclick: guarded(action) }, text);
}

export function checkbox(text, checked, action, title = "") {
  return make("label", { title }, make("input", { type: "checkbox", checked, onchange: event => action(event.target.checked) }), text);
}

export function slider(text, min, max, value, action, title = "") {
  const input = make("input", { type: "range", min, max, step: "any", value, oninput: event => action(+event.target.value) });
  return make("label", { title }, text, input);
}

export function choice(text, options, value, action) {
  const select = make("select", { onchange: event => action(event.target.value) },
    ...Object.entries(options).map(([key, words]) => make("option", { value: key, selected: key === value }, words)));
  return make("label", {}, text, select);
}

export function say(text) {
  const place = document.getElementById("message");
  place.textContent = text;
  place.hidden = !text;
  clearTimeout(say.timer);
  if (text) say.timer = setTimeout(() => { place.hidden = true; }, 12000);
}

// The field in which somebody types, and how to give it back when the elements around it were made anew.
export function fieldHeld(parent) {
  const field = document.activeElement;
  if (!field || !field.id || !parent.contains(field)) return () => {};
  const selected = [field.selectionStart, field.selectionEnd];
  return () => {
    const now = document.getElementById(field.id);
    if (!now || !parent.contains(now)) return;
    now.focus({ preventScroll: true });
    if (typeof selected[0] === "number") now.setSelectionRange(...selected);
  };
}

// An action whose error is told to the user, not lost.
export function guarded(action) {
  return async (...given) => {
    try { return await action(...given); } catch (error) { say(error.message); }
  };
}

export function fixed(value, digits) {
  return value === null || value === undefined ? "" : value.toFixed(digits);
}
