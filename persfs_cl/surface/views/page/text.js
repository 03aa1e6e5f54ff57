// Numbers, names and addresses as text, and elements of the page.

const MISSING = "–";

/** A number with so many digits that count. */
function figure(value, digits = 4) {
  if (!Number.isFinite(value)) return MISSING;
  if (Number.isInteger(value) && Math.abs(value) < 1e15) return value.toLocaleString("en");
  const size = Math.abs(value);
  if (size < 1e-4 || size >= 1e6) return value.toExponential(digits - 1);
  return String(Number(value.toPrecision(digits)));
}

function duration(seconds) {
  if (!Number.isFinite(seconds)) return MISSING;
  if (seconds < 100) return `${figure(seconds, seconds < 1 ? 2 : 3)} s`;
  const minutes = Math.round(seconds / 60);
  if (minutes < 120) return `${minutes} min`;
  return `${figure(Math.floor(minutes / 60))} h ${minutes % 60} min`;
}

function counted(count, one, many = `${one}s`) {
  return `${figure(count)} ${count === 1 ? one : many}`;
}

const hexadecimal = (code) => `%${code.toString(16).toUpperCase()}`;

/**
 * Part of an address. A byte of a file's name that is no text arrives as a lone surrogate, U+DC80 to U+DCFF, for which
 * encodeURIComponent has no answer.
 */
function quoted(part) {
  return Array.from(part, (letter) => {
    const code = letter.charCodeAt(0);
    const lone = letter.length === 1 && code >= 0xd800 && code <= 0xdfff;
    // Some signs that it leaves alone are quoted by others, and an address is to be the same whoever made it.
    if (!lone) return "!'()*".includes(letter) ? hexadecimal(code) : encodeURIComponent(letter);
    return code >= 0xdc80 && code <= 0xdcff ? hexadecimal(code - 0xdc00) : "%EF%BF%BD";
  }).join("");
}

/** Address of a file of an image, seen from this page. */
function address(name, file) {
  return ["."].concat(name === "" ? [] : name.split("/"), file.split("/")).map(quoted).join("/");
}

/** An element with properties and children; text is text, whatever it holds. */
function element(kind, properties = {}, ...children) {
  const made = document.createElement(kind);
  for (const [name, value] of Object.entries(properties)) {
    if (name in made) made[name] = value;
    else made.setAttribute(name, value);
  }
  made.append(...children);
  return made;
}

/** Terms and what stands for them, each pair in a block of its own; what has no value is left out. */
function definitions(pairs) {
  return pairs
    .filter(([, value]) => value !== null && value !== undefined && value !== MISSING)
    .map(([term, value]) => {
      const className = String(value).length > 18 ? "wide" : "";
      return element("div", { className }, element("dt", {}, term), element("dd", {}, value));
    });
}

const find = (selector) => document.querySelector(selector);
