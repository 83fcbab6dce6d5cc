"use strict";

/* Films: cubic pieces as whole numbers, written by film.py (`encoded`). */
function decoded([nodes, numbers], frames) {
  const width = 4 * nodes, out = [];
  let place = new Array(width).fill(0), step = place;
  for (let f = 0; f < frames; f++) {
    const change = numbers.slice(f * width, (f + 1) * width);
    if (f === 0) place = change;
    else {
      step = f === 1 ? change : step.map((s, i) => s + change[i]);
      place = place.map((p, i) => p + step[i]);
    }
    out.push(place);
  }
  return out;
}

function curve(frames, time) {
  const f = Math.min(Math.floor(time), frames.length - 2), part = time - f;
  const q = frames[f].map((a, i) => a + part * (frames[f + 1][i] - a));
  let d = `M${q[0].toFixed(1)} ${q[1].toFixed(1)}`;
  for (let i = 4; i < q.length; i += 4) {
    const points = [q[i - 4] + q[i - 2], q[i - 3] + q[i - 1], q[i] - q[i + 2], q[i + 1] - q[i + 3], q[i], q[i + 1]];
    d += "C" + points.map(p => p.toFixed(1)).join(" ");
  }
  return d;
}

function film(figure) {
  const data = JSON.parse(figure.querySelector("script").textContent), tEnd = Number(figure.dataset.tEnd);
  const [button, slider, shown, speed] = ["button", "input", "output", "select"].map(n => figure.querySelector(n));
  const paths = [...figure.querySelectorAll("path.body")].reverse();
  const bodies = data.layers.flat().map(body => decoded(body, data.frames));
  let playing = false, before = 0;

  function draw() {
    const t = Number(slider.value);
    paths.forEach((path, i) => path.setAttribute("d", curve(bodies[i], t / tEnd * (data.frames - 1))));
    shown.textContent = `${t.toFixed(2)} s`;
  }
  function play(on) {
    playing = on;
    button.textContent = on ? "Pause" : "Play";
    if (!on) return;
    if (Number(slider.value) >= tEnd) slider.value = 0;
    before = performance.now();
    requestAnimationFrame(tick);
  }
  function tick(now) {
    if (!playing) return;
    // a frame that comes late, of a busy machine or a hidden page, must not jump to the end
    const passed = Math.min(Math.max(0, now - before), 100) / 1000;
    const t = Number(slider.value) + passed * Number(speed.value);
    before = now;
    slider.value = Math.min(t, tEnd);
    draw();
    if (t >= tEnd) play(false); else requestAnimationFrame(tick);
  }
  button.addEventListener("click", () => play(!playing));
  slider.addEventListener("input", () => { play(false); draw(); });
  draw();
}

/* Tables: a head is a button; numbers by value, other cells as people order them, empty ones last. */
function sort(head) {
  const table = head.closest("table"), body = table.tBodies[0], column = head.cellIndex;
  const down = head.getAttribute("aria-sort") === "ascending", sign = down ? -1 : 1;
  const numeric = head.classList.contains("number");
  table.querySelectorAll("th[aria-sort]").forEach(h => h.removeAttribute("aria-sort"));
  head.setAttribute("aria-sort", down ? "descending" : "ascending");
  const rows = [...body.rows].map((row, i) => [row.cells[column].textContent, i, row]);
  const compared = (a, b) => numeric ? Number(a) - Number(b) : a.localeCompare(b, "en", { numeric: true });
  rows.sort(([a, i], [b, j]) => (a === "") - (b === "") || sign * compared(a, b) || i - j);
  body.append(...rows.map(([, , row]) => row));
}

/* Markers: pointing shows their text as any title; a tap, which cannot point, shows it below the picture. */
function tell(event) {
  const title = event.target.closest("use")?.querySelector("title"), figure = event.target.closest("figure");
  if (title) figure.querySelector(".told").textContent = title.textContent;
}

/* What is wider than its place scrolls: the style says so, as no bar shows on a phone. */
function mark(box) {
  const beyond = box.scrollWidth - box.clientWidth;
  box.classList.toggle("wide", beyond > 1);
  box.classList.toggle("more", beyond - box.scrollLeft > 1);
}
// in the next frame: the words change the height, which is observed, too
const places = new ResizeObserver(seen => requestAnimationFrame(() => seen.forEach(one => mark(one.target))));
document.querySelectorAll(".scroll, .cards thead").forEach(box => {
  places.observe(box);
  box.addEventListener("scroll", () => mark(box), { passive: true });
});

document.querySelectorAll(".film").forEach(film);
document.querySelectorAll("figure .scroll").forEach(s => s.addEventListener("click", tell));
document.querySelectorAll("th button").forEach(b => b.addEventListener("click", () => sort(b.parentElement)));
