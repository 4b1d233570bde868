"use strict";
(() => {
  const plan = document.getElementById("plan");
  const tip = document.getElementById("tip");
  const home = plan.getAttribute("viewBox").split(" ").map(Number);
  let view = [...home];

  // The map's frame in pixels. What is printed is laid out before the paper's is known: A4 within its margins.
  let paper = false;
  const frameOf = () => paper
    ? { left: 0, top: 0, width: 700, height: Math.min(540, 700 * home[3] / home[2]) }
    : plan.getBoundingClientRect();

  // Picture units a pixel: the drawing keeps its proportions, so the tighter side decides.
  const unit = () => {
    const box = frameOf();
    return Math.max(view[2] / Math.max(box.width, 1), view[3] / Math.max(box.height, 1));
  };

  let arrangedAt = 0;
  const show = () => {
    const u = unit();
    if (u !== arrangedAt) arrange(); // moving changes nothing
    arrangedAt = u;
    plan.setAttribute("viewBox", view.join(" "));
    plan.classList.add("live");
    plan.style.setProperty("--unit", u);
    // The longest round length that is at most 150 pixels long.
    const room = 150 * u;
    const power = 10 ** Math.floor(Math.log10(room));
    const length = [5, 2, 1].map((k) => k * power).find((k) => k <= room);
    const box = frameOf();
    const left = view[0] + view[2] / 2 - (box.width / 2 - 14) * u;
    const low = view[1] + view[3] / 2 + (box.height / 2 - 14) * u;
    const scale = document.getElementById("scale");
    scale.setAttribute("transform", `translate(${left} ${low})`);
    scale.querySelector("path").setAttribute("d", `M0 0H${length}`);
    const text = scale.querySelector("text");
    text.setAttribute("transform", `scale(${u})`);
    text.textContent = length >= 100 ? `${length / 100} m` : `${length} cm`;
  };

  // Names stand where they cover least, to the upper right of their marks if they may: names of anchors
  // first. A room's area is left out where something else stands: its row has it.
  const MOST = 400; // marks; more are not legible anyway, and would make zooming slow
  const covered = (box, taken) => taken.reduce((sum, other) => sum
    + Math.max(0, Math.min(box[2], other[2]) - Math.max(box[0], other[0]))
    * Math.max(0, Math.min(box[3], other[3]) - Math.max(box[1], other[1])), 0);
  const placesOf = (r, width) => [
    [r, -5, "start"], [r, 13, "start"], [-r, -5, "end"], [-r, 13, "end"],
    [r + 3, 4, "start"], [-r - 3, 4, "end"], [0, -r - 4, "middle"], [0, r + 12, "middle"],
  ].map(([x, y, side]) => {
    const left = x - { start: 0, middle: width / 2, end: width }[side];
    return { x, y, side, box: [left, y - 10, left + width, y + 2] };
  });
  const shifted = (box, [x, y]) => [box[0] + x, box[1] + y, box[2] + x, box[3] + y];
  const placeNames = () => {
    const u = unit();
    const turned = (item) => item.transform.baseVal.consolidate().matrix;
    const at = (item) => [turned(item).e / u, turned(item).f / u];
    const rank = (item) => ["anchor", "station", "plan"].findIndex((kind) => item.classList.contains(kind));
    const marks = [...plan.querySelectorAll("g:not(.off) > .mark")].sort((a, b) => rank(a) - rank(b));
    if (marks.length > MOST) return;
    const taken = [];
    marks.forEach((mark) => {
      taken.push(shifted([-6, -6, 6, 6], at(mark)));
      const heading = mark.querySelector(".heading");
      if (!heading) return;
      const { a, b } = turned(heading);
      taken.push(shifted([11 * a - 3, 11 * b - 3, 11 * a + 3, 11 * b + 3], at(mark)));
    });
    const frame = frameOf();
    const [x, y] = [view[0] + view[2] / 2, view[1] + view[3] / 2];
    const edges = [x / u - frame.width / 2, y / u - frame.height / 2, x / u + frame.width / 2, y / u + frame.height / 2];
    const buttons = document.querySelector(".buttons").getBoundingClientRect();
    const [dx, dy] = [edges[0] - frame.left, edges[1] - frame.top];
    if (!paper) taken.push([buttons.left + dx, buttons.top + dy, buttons.right + dx, buttons.bottom + dy]);
    const beyond = (box) => Math.max(0, edges[0] - box[0]) + Math.max(0, edges[1] - box[1])
      + Math.max(0, box[2] - edges[2]) + Math.max(0, box[3] - edges[3]);
    // All is measured before anything is changed: else the browser would measure anew for each.
    const names = marks.map((mark) => mark.querySelector(".name")).filter(Boolean)
      .map((name) => ({ name, mark: name.closest(".mark"), width: name.getComputedTextLength() }));
    const rooms = [...plan.querySelectorAll(".room")]
      .map((room) => ({ room, half: room.querySelector(".name").getComputedTextLength() / 2 }));
    names.forEach(({ name, mark, width }) => {
      const places = placesOf(mark.querySelector("circle") ? 6 : 9, width);
      const costs = places.map((place, k) => {
        const box = shifted(place.box, at(mark));
        return covered(box, taken) + 15 * beyond(box) + 2 * k;
      });
      const best = places[costs.indexOf(Math.min(...costs))];
      name.setAttribute("x", best.x);
      name.setAttribute("y", best.y);
      name.setAttribute("text-anchor", best.side);
      taken.push(shifted(best.box, at(mark)));
    });
    rooms.forEach(({ room, half }) => {
      room.classList.toggle("crowded", covered(shifted([-half, -10, half, 2], at(room)), taken) > 0);
    });
  };
  let arranging = 0;
  const arrange = () => {
    cancelAnimationFrame(arranging);
    arranging = requestAnimationFrame(placeNames);
  };

  // The place under a pixel of the window, in picture units.
  const placeAt = (x, y) => {
    const box = plan.getBoundingClientRect();
    const u = unit();
    return [
      view[0] + view[2] / 2 + (x - box.left - box.width / 2) * u,
      view[1] + view[3] / 2 + (y - box.top - box.height / 2) * u,
    ];
  };

  const zoom = (factor, x, y) => {
    const size = view[2] / factor;
    if (size < home[2] / 400 || size > home[2] * 20) return;
    view = [x - (x - view[0]) / factor, y - (y - view[1]) / factor, size, view[3] / factor];
    show();
  };
  const middle = () => [view[0] + view[2] / 2, view[1] + view[3] / 2];
  const move = (dx, dy) => { view[0] += dx; view[1] += dy; show(); };
  const all = () => { view = [...home]; show(); };

  plan.addEventListener("wheel", (event) => {
    event.preventDefault();
    zoom(Math.exp(-event.deltaY * (event.deltaMode ? 0.05 : 0.0015)), ...placeAt(event.clientX, event.clientY));
  }, { passive: false });

  // One finger or the mouse moves, two fingers zoom.
  const fingers = new Map();
  plan.addEventListener("pointerdown", (event) => {
    fingers.set(event.pointerId, [event.clientX, event.clientY]);
  });
  plan.addEventListener("pointermove", (event) => {
    const before = fingers.get(event.pointerId);
    if (!before) return;
    plan.setPointerCapture(event.pointerId);
    const now = [event.clientX, event.clientY];
    const others = [...fingers.entries()].filter(([id]) => id !== event.pointerId);
    if (others.length === 1) {
      const other = others[0][1];
      const far = (p) => Math.max(Math.hypot(p[0] - other[0], p[1] - other[1]), 1);
      zoom(far(now) / far(before), ...placeAt((now[0] + other[0]) / 2, (now[1] + other[1]) / 2));
    } else {
      const u = unit();
      move((before[0] - now[0]) * u, (before[1] - now[1]) * u);
    }
    fingers.set(event.pointerId, now);
  });
  for (const end of ["pointerup", "pointercancel", "pointerleave"]) {
    plan.addEventListener(end, (event) => fingers.delete(event.pointerId));
  }

  plan.addEventListener("keydown", (event) => {
    const step = view[2] / 10;
    const keys = {
      "+": () => zoom(1.25, ...middle()), "=": () => zoom(1.25, ...middle()),
      "-": () => zoom(0.8, ...middle()), "0": all,
      ArrowLeft: () => move(-step, 0), ArrowRight: () => move(step, 0),
      ArrowUp: () => move(0, -step), ArrowDown: () => move(0, step),
    };
    if (keys[event.key] && !event.ctrlKey && !event.metaKey) { event.preventDefault(); keys[event.key](); }
  });
  document.querySelectorAll("[data-zoom]").forEach((button) => button.addEventListener("click", () => {
    const does = { in: () => zoom(1.5, ...middle()), out: () => zoom(1 / 1.5, ...middle()), all };
    does[button.dataset.zoom]();
  }));

  // What is hovered or tapped says its values, and lights up with all that belongs to it.
  const keysOf = (item) => (item.dataset.key || item.dataset.keys || "").split(" ").filter(Boolean);
  const light = (item) => {
    document.querySelectorAll(".lit").forEach((other) => other.classList.remove("lit"));
    if (!item) return;
    const keys = keysOf(item);
    document.querySelectorAll("[data-key], [data-keys]").forEach((other) => {
      const own = keysOf(other);
      const few = own.length < keys.length ? own : keys;
      const many = few === own ? keys : own;
      if (few.every((key) => many.includes(key))) other.classList.add("lit");
    });
  };
  const tell = (event) => {
    const item = event.target.closest("[data-tip]");
    light(item);
    tip.hidden = !item;
    if (!item) return;
    tip.textContent = item.dataset.tip;
    const frame = plan.parentElement.getBoundingClientRect();
    const x = event.clientX - frame.left, y = event.clientY - frame.top;
    tip.style.left = `${Math.max(Math.min(x + 14, frame.width - tip.offsetWidth - 6), 4)}px`;
    tip.style.top = `${y + 14 + tip.offsetHeight > frame.height ? Math.max(y - tip.offsetHeight - 10, 4) : y + 14}px`;
  };
  plan.addEventListener("pointerover", tell);
  plan.addEventListener("pointerdown", tell);
  plan.addEventListener("mouseleave", () => { tip.hidden = true; light(null); });
  document.querySelectorAll("tbody").forEach((body) => {
    body.addEventListener("mouseover", (event) => light(event.target.closest("tr")));
    body.addEventListener("mouseleave", () => light(null));
  });

  document.querySelectorAll("input[data-layer]").forEach((box) => {
    const apply = () => {
      plan.querySelectorAll(`g[data-layer="${box.dataset.layer}"]`).forEach((layer) => layer.classList.toggle("off", !box.checked));
      arrange();
    };
    box.addEventListener("change", apply);
    apply(); // a reloaded page keeps its boxes
  });
  document.querySelectorAll("input[data-more]").forEach((box) => {
    const apply = () => document.querySelector(`#${box.dataset.more} table`).classList.toggle("few", !box.checked);
    box.addEventListener("change", apply);
    apply();
  });

  // Numbers by value, words as people count (s2 before s10), what is empty last either way.
  const words = new Intl.Collator("en", { numeric: true });
  const compare = (a, b) => {
    const [x, y] = [a.dataset.value, b.dataset.value];
    if (x !== undefined && y !== undefined) return x - y;
    return words.compare(a.textContent, b.textContent);
  };
  document.querySelectorAll("th button").forEach((button) => button.addEventListener("click", () => {
    const head = button.parentElement;
    const column = head.cellIndex;
    const body = head.closest("table").tBodies[0];
    const down = head.getAttribute("aria-sort") === "ascending";
    head.parentElement.querySelectorAll("th").forEach((other) => other.removeAttribute("aria-sort"));
    head.setAttribute("aria-sort", down ? "descending" : "ascending");
    const rows = [...body.rows].sort((p, q) => {
      const [a, b] = [p.cells[column], q.cells[column]];
      const empty = (a.textContent === "") - (b.textContent === "");
      return empty || (down ? -1 : 1) * compare(a, b);
    });
    body.append(...rows);
  }));

  window.addEventListener("beforeprint", () => { paper = true; show(); placeNames(); });
  window.addEventListener("afterprint", () => { paper = false; show(); });
  new ResizeObserver(show).observe(plan);
  show();
})();
