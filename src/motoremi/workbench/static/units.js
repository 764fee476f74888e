// Numbers as engineers write them.

const PREFIXES = ["f", "p", "n", "µ", "m", "", "k", "M", "G", "T"];
const PLAIN = new Set(["", "1", "%", "dB", "°", "deg", "dBµV", "dBΩ"]);

export function show(value, unit = "", digits = 4) {
  if (value === null || value === undefined || !Number.isFinite(value)) return "-";
  if (PLAIN.has(unit)) return join(short(value, digits), unit === "1" ? "" : unit);
  if (value === 0) return join("0", unit);
  const step = Math.min(Math.max(Math.floor(Math.log10(Math.abs(value)) / 3 + 1e-9), -5), 4);
  return join(short(value / 1000 ** step, digits), PREFIXES[step + 5] + unit);
}

const join = (number, unit) => (unit === "°" || !unit ? number + unit : `${number}\u00a0${unit}`);

function short(value, digits) {
  return String(Number(value.toPrecision(digits)));
}

export const percent = (value) => show(value, "%", 3);
export const share = (value) => `${(100 * value).toFixed(value < 0.0995 && value > 0 ? 1 : 0)}\u00a0%`;
// A time of the session, as this computer's clock shows it.
export function when(text, seconds = false) {
  const time = new Date(text);
  if (!text || Number.isNaN(time.getTime())) return "";
  const two = (number) => String(number).padStart(2, "0");
  return `${time.getFullYear()}-${two(time.getMonth() + 1)}-${two(time.getDate())} ${two(time.getHours())}:${two(time.getMinutes())}${seconds ? `:${two(time.getSeconds())}` : ""}`;
}

export const band = (low, high) => `${show(low, "Hz")} - ${show(high, "Hz")}`;
