// Questions to the bench; paths are relative, so that the token of the address goes with them.

export async function ask(path, parameters = {}) {
  const given = Object.entries(parameters).filter(([, value]) => value !== null && value !== undefined && value !== "");
  return answered(await fetch(path + (given.length ? "?" + new URLSearchParams(given) : "")));
}

export async function tell(path, content = {}) {
  return answered(await fetch(path, { method: "POST", headers: { "Content-Type": "application/json" }, body: JSON.stringify(content) }));
}

async function answered(response) {
  const content = await response.json().catch(() => ({ error: "the bench has ended: start `aerotri view` again" }));
  if (!response.ok) throw new Error(content.error || response.statusText);
  return content;
}
