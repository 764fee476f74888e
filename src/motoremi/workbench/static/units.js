// Numbers in engineering notation.

const PREFIXES = ["f", "p", "n", "µ", "m", "", "k", "M", "G", "T"];
const PLAIN = new Set(["", "1", "%", "dB", "°", "deg", "dBµV", "dBΩ"]);

// Unit-less numbers outside this range are written with a power of ten that is a multiple of three.
const LARGE = 1e4, SMALL = 1e-3;
// Errors in per cent are read more easily without: 20000 %.
const LARGE_PERCENT = 1e6;
const SUPERSCRIPTS = Object.fromEntries([..."-0123456789"].map((digit, index) => [digit, "⁻⁰¹²³⁴⁵⁶⁷⁸⁹"[index]]));

export function show(value, unit = "", digits = 4) {
  if (value === null || value === undefined || !Number.isFinite(value)) return "-";
  if (PLAIN.has(unit)) return join(plain(value, digits, unit === "%" ? LARGE_PERCENT : LARGE), unit === "1" ? "" : unit);
  if (value === 0) return join("0", unit);
  // Rounded first: 999.96 Hz is 1 kHz, not 1000 Hz.
  const rounded = Number(value.toPrecision(digits)), step = prefixOf(rounded);
  return join(short(rounded / 1000 ** step, digits), PREFIXES[step + 5] + unit);
}

// A tick label: with the prefix of the axis' largest value, and enough decimals for its step.
export function prefixed(value, unit, { scale, step } = {}) {
  if (!step) return show(value, unit, 5);
  const power = PLAIN.has(unit) ? 0 : prefixOf(scale), divisor = 1000 ** power;
  if (PLAIN.has(unit) && (scale >= LARGE || step < SMALL ** 2)) return show(value, unit, 6);
  const decimals = Math.min(9, Math.max(0, Math.ceil(-Math.log10(step / divisor) - 1e-6)));
  return join((value / divisor).toFixed(decimals), (PLAIN.has(unit) ? "" : PREFIXES[power + 5]) + (unit === "1" ? "" : unit));
}

const prefixOf = (value) => Math.min(Math.max(Math.floor(Math.log10(Math.abs(value)) / 3 + 1e-9), -5), 4);

function plain(value, digits, large) {
  const size = Math.abs(value);
  if (size === 0 || (size < large && size >= SMALL)) return short(value, digits);
  const power = 3 * Math.floor(Math.log10(size) / 3 + 1e-9);
  return `${short(value / 10 ** power, digits)} × 10${[...String(power)].map((digit) => SUPERSCRIPTS[digit]).join("")}`;
}

const join = (number, unit) => (unit === "°" || !unit ? number + unit : `${number}\u00a0${unit}`);

function short(value, digits) {
  return String(Number(value.toPrecision(digits)));
}

export const percent = (value) => show(value, "%", 3);

// A probability, never shown as certain or impossible.
export function chance(value) {
  if (value > 0.995) return "> 99\u00a0%";
  return value < 0.0005 ? "< 0.1\u00a0%" : share(value);
}

// Larger differences are not shown exactly.
const FAR = 1000;
export const lag = (value) => (value > FAR ? `> ${FAR}` : show(value, "", 3));

// A duration in hours, minutes and seconds.
export function duration(seconds) {
  const whole = Math.max(0, Math.round(seconds)), minutes = Math.floor(whole / 60), two = (number) => String(number).padStart(2, "0");
  if (minutes < 1) return `${whole}\u00a0s`;
  if (minutes < 60) return `${minutes}\u00a0min ${two(whole % 60)}\u00a0s`;
  return `${Math.floor(minutes / 60)}\u00a0h ${two(minutes % 60)}\u00a0min`;
}

// Replaces the ASCII units of files and command line by symbols.
export const symbols = (text) => text.replace(/([\d.] ?[a-zA-Z]?)Ohm\b/g, "$1Ω").replace(/(\d ?)u([HFsAV])\b/g, "$1µ$2").replace(/(\d ?)uΩ/g, "$1µΩ").replace(/dBuV/g, "dBµV");

export const share = (value) => `${(100 * value).toFixed(value < 0.0995 && value > 0 ? 1 : 0)}\u00a0%`;
// A time of the session, in local time.
export function when(text, seconds = false) {
  const time = new Date(text);
  if (!text || Number.isNaN(time.getTime())) return "";
  const two = (number) => String(number).padStart(2, "0");
  return `${time.getFullYear()}-${two(time.getMonth() + 1)}-${two(time.getDate())} ${two(time.getHours())}:${two(time.getMinutes())}${seconds ? `:${two(time.getSeconds())}` : ""}`;
}

export const band = (low, high) => `${show(low, "Hz")} - ${show(high, "Hz")}`;
