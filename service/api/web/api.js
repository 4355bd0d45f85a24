/**
 * Requests to the server: what it answered, or one sentence for people that says why there is no answer.
 */

const ANSWER_MS = 10_000;
export const NO_ANSWER = "The server did not answer. Try again when it is back.";

/** Return the path of a device's resource: `of(device, "calibrations", 3)`. */
export function of(device, ...parts) {
  return ["api/v1/devices", ...[device.id, ...parts].map(encodeURIComponent)].join("/");
}

/**
 * Ask for `path`; resolves always, to `{value, error, status}`.
 *
 * `value` is the answer's JSON, null where there is none; `error` is null where all went well, `status` 0 where the
 * server was not reached.
 */
export async function request(path, { method = "GET", body, timeoutMs = ANSWER_MS } = {}) {
  const headers = { "Content-Type": "application/json" };
  const json = body === undefined ? {} : { body: JSON.stringify(body), headers };
  try {
    const url = new URL(path, document.baseURI);
    const answer = await fetch(url, { method, signal: AbortSignal.timeout(timeoutMs), ...json });
    const value = await parsed(answer);
    return { value, status: answer.status, error: answer.ok ? null : refusal(answer, value) };
  } catch {
    return { value: null, status: 0, error: NO_ANSWER };
  }
}

async function parsed(answer) {
  const text = await answer.text();
  try {
    return JSON.parse(text);
  } catch {
    return null;
  }
}

function refusal({ status, statusText }, value) {
  return typeof value?.detail === "string" ? value.detail : `The server answered ${status} ${statusText}`.trim();
}
