// What every report does in a browser: light or dark, commands to copy, pictures that become views where the browser can.
"use strict";
document.documentElement.classList.add("js");
// Numbers are written alike in every language; and uPlot would not start in one that no page can read (LANG=C: en-US@posix).
Object.defineProperty(navigator, "language", { value: "en-US" });

function remembered(value) {
  try {
    if (value === undefined) return localStorage.getItem("compstiff-theme");
    localStorage.setItem("compstiff-theme", value);
  } catch { /* a browser that remembers nothing for files */ }
  return null;
}
if (["light", "dark"].includes(remembered())) document.documentElement.dataset.theme = remembered();

const isDark = () => (document.documentElement.dataset.theme ||
  (matchMedia("(prefers-color-scheme: dark)").matches ? "dark" : "light")) === "dark";
const themeChanged = new Set();     // what to draw anew
const colour = name => getComputedStyle(document.documentElement).getPropertyValue(`--${name}`).trim();
// Thin blanks between thousands from five digits on, a point for the decimals, whatever the language of the browser.
const shown = (value, digits) => value.toFixed(digits).replace(/^-(?=0\.?0*$)/, "").replace("-", "\u2212")
  .replace(/^\u2212?\d{5,}/, whole => whole.replace(/\B(?=(\d{3})+$)/g, "\u202f"));

async function inflated(text) {
  const bytes = Uint8Array.from(atob(text), letter => letter.charCodeAt(0));
  return new Response(new Blob([bytes]).stream().pipeThrough(new DecompressionStream("deflate"))).arrayBuffer();
}
// The other side of packed.py: four planes of bytes, differences down each column.
async function integers(text, columns) {
  const planes = new Uint8Array(await inflated(text)), count = planes.length / 4, values = new Int32Array(count), rows = count / columns;
  for (let i = 0; i < count; i++)
    values[i] = planes[i] | planes[count + i] << 8 | planes[2 * count + i] << 16 | planes[3 * count + i] << 24;
  for (let c = 0; c < columns; c++)
    for (let i = c * rows + 1; i < (c + 1) * rows; i++) values[i] = values[i] + values[i - 1] | 0;
  return values;
}

document.addEventListener("DOMContentLoaded", () => {
  const button = document.getElementById("theme");
  const named = () => { button.textContent = isDark() ? "Light" : "Dark"; };
  button.addEventListener("click", () => {
    document.documentElement.dataset.theme = isDark() ? "light" : "dark";
    remembered(document.documentElement.dataset.theme);
    named(); themeChanged.forEach(draw => draw());
  });
  matchMedia("(prefers-color-scheme: dark)").addEventListener("change", () => { named(); themeChanged.forEach(draw => draw()); });
  named();
  for (const copy of document.querySelectorAll("button.copy")) copy.addEventListener("click", async () => {
    const code = copy.parentElement.querySelector("code"), told = document.getElementById("told");
    try {
      await navigator.clipboard.writeText(code.textContent);
    } catch {
      const range = document.createRange(); range.selectNodeContents(code);
      getSelection().removeAllRanges(); getSelection().addRange(range); document.execCommand("copy");
    }
    copy.textContent = "Copied"; told.textContent = "Command copied";
    setTimeout(() => { copy.textContent = "Copy"; told.textContent = ""; }, 2000);
  });
  for (const [kind, start] of [["scene", window.startScene], ["path", window.startPath]])
    for (const figure of document.querySelectorAll(`figure[data-view=${kind}]`))
      start(figure, JSON.parse(figure.querySelector("script").textContent)).catch(reason => {
        figure.classList.remove("has-view");
        console.warn(`the picture stays: ${reason}`);
      });
  addEventListener("beforeprint", () => document.querySelectorAll("main > details, .next > details").forEach(one => { one.dataset.was = one.open; one.open = true; }));
  addEventListener("afterprint", () => document.querySelectorAll("main > details, .next > details").forEach(one => { one.open = one.dataset.was === "true"; }));
});
