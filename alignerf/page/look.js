// One photo: two of its layers under a slider, in turn, or side by side.
const look = (() => {
  // Of arrows: as many times as long as the shift, so that neighbours do not meet.
  const LONGER = [32, 16, 8, 4, 2], TURN_MS = 600;
  if (!data.opening) return null;
  const photos = new Map(data.photos.map((one) => [one.key, one]));
  const keys = data.photos.map((one) => one.key).filter((key) => key in data.images);
  const after = data.after[0];
  const pairs = {
    "before-after": ["render", after], "photo-before": ["photo", "render"],
    "photo-after": ["photo", after],
  };
  const now = {
    key: data.opening.key, wanted: [data.opening.left, data.opening.right],
    mode: "side", part: 0, second: false,
  };
  let timer = 0;

  // What the chosen part of the photo has: {layers, offset_px}.
  function part() {
    return (data.crops[now.key] ?? [])[now.part - 1] ?? { layers: data.images[now.key] };
  }

  function fill(select, names, chosen) {
    select.replaceChildren(...names.map(([value, text]) => new Option(text, value)));
    select.value = chosen;
  }

  // The two layers, or the nearest that there are.
  function chosen(names) {
    return now.wanted.map((name, side) => (
      names.includes(name) ? name : names[Math.min(side, names.length - 1)]
    ));
  }

  function picture(name) {
    const { layers, offset_px } = part();
    const moved = offset_px && !["photo", "render"].includes(name);
    return {
      src: layers[name], name: title(name), alt: `${name} of ${photos.get(now.key).name}`,
      offset: moved ? offset_px : null, sharp: now.part > 0, over: draw,
    };
  }

  function title(name) {
    if (name === "render" && after) return "before any fix";
    const whose = name.replace(/^render,? ?/, "");
    return name !== after || whose.startsWith("after") ? whose || name : `after: ${whose}`;
  }

  // The shift as arrows, from the middles of squares.
  function draw(svg) {
    const { size, step, tips } = photos.get(now.key).arrows;
    svg.replaceChildren();
    const lengths = tips.filter((tip) => tip).map((tip) => Math.hypot(...tip) / 10);
    lengths.sort((a, b) => a - b);
    const most = lengths[Math.floor(0.9 * lengths.length)] ?? 0;
    const longer = LONGER.find((times) => times * most <= 1.5 * step) ?? 1;
    $("longer").textContent = longer > 1 ? `, ${longer} times as long` : "";
    if (!$("arrows").checked || now.part) return;
    svg.setAttribute("viewBox", `0 0 ${size.join(" ")}`);
    const across = Math.ceil(size[0] / step);
    const lines = tips.map((tip, i) => {
      if (!tip) return "";
      const x = (i % across + 0.5) * step, y = (Math.floor(i / across) + 0.5) * step;
      const [dx, dy] = tip.map((tenths) => longer * tenths / 10);
      const head = [0.6, -0.6].map((turn) => {
        const [c, s] = [Math.cos(turn), Math.sin(turn)];
        const [u, v] = [-0.35 * (c * dx - s * dy), -0.35 * (s * dx + c * dy)];
        return `M${x + dx} ${y + dy}l${u.toFixed(2)} ${v.toFixed(2)}`;
      });
      return `M${x} ${y}l${dx} ${dy}${head.join("")}`;
    });
    svg.innerHTML = `<path class="edge" d="${lines.join("")}"/><path d="${lines.join("")}"/>`;
  }

  function show() {
    const one = photos.get(now.key), crops = data.crops[now.key] ?? [];
    now.part = Math.min(now.part, crops.length);
    const names = data.layers.filter((name) => name in part().layers);
    const others = Object.keys(part().layers).filter((name) => !names.includes(name));
    names.push(...others);
    const pair = chosen(names);
    $("view").value = now.key;
    $("regions").hidden = !crops.length;
    fill($("region"), [[0, "whole photo"], ...crops.map(
      (_, i) => [i + 1, `crop ${i + 1}, full resolution`],
    )], now.part);
    ["left", "right"].forEach((id, side) => {
      fill($(id), names.map((name) => [name, name]), pair[side]);
    });
    const made = pair.map(picture);
    $("slide").hidden = now.mode !== "slide";
    $("panes").hidden = now.mode === "slide";
    $("zooms").hidden = now.mode === "slide";
    ["first", "second"].forEach((id, side) => {
      const image = $(id);
      image.src = made[side].src;
      image.alt = made[side].alt;
      image.classList.toggle("sharp", made[side].sharp);
      const [x, y] = made[side].offset ?? [0, 0];
      image.onload = () => {
        const [w, h] = [image.naturalWidth, image.naturalHeight];
        image.style.transform = `translate(${100 * x / w}%, ${100 * y / h}%)`;
        $("slide").style.setProperty("--shape", w / h);
      };
    });
    $("tag-left").textContent = made[0].name;
    $("tag-right").textContent = made[1].name;
    draw($("over"));
    if (now.mode === "side") panes.show($("panes"), sides(names, pair).map(picture));
    if (now.mode === "blink") panes.show($("panes"), [made[Number(now.second)]]);
    $("print-left").src = made[0].src;
    $("print-right").src = made[1].src;
    $("caption").textContent = caption(one, pair);
    press();
  }

  // Side by side there is space for the photo, too.
  function sides(names, pair) {
    return pair.includes("photo") || !names.includes("photo") ? pair : [...pair, "photo"];
  }

  function caption(one, pair) {
    const why = one.why ? ` It stands out: ${one.why}.` : "";
    if (now.part) return `${one.name}: a crop at full resolution.${why}`;
    const words = pair.map((name, side) => `${side ? "Right" : "Left"}: ${one.captions[name]}.`);
    return `${one.name}. ${words.join(" ")}${why}`;
  }

  function press() {
    const shown = now.wanted.join();
    document.querySelectorAll("[data-pair]").forEach((button) => {
      button.setAttribute("aria-pressed", pairs[button.dataset.pair].join() === shown);
    });
    document.querySelectorAll("[data-mode]").forEach((button) => {
      button.setAttribute("aria-pressed", button.dataset.mode === now.mode);
    });
  }

  function stop() {
    clearInterval(timer);
    timer = 0;
  }

  function flip() {
    now.second = !now.second;
    show();
  }

  function change(mode) {
    stop();
    now.mode = mode;
    panes.zoom(0);
    show();
    const still = matchMedia("(prefers-reduced-motion: reduce)").matches;
    if (mode === "blink" && !still) timer = setInterval(flip, TURN_MS);
  }

  // Whether there was such a photo. Its address is that of the page with it.
  function open(key) {
    const found = keys.find((one) => one === key)
      ?? keys.find((one) => photos.get(one).name === key);
    if (!found) return false;
    Object.assign(now, { key: found, part: 0 });
    panes.zoom(0);
    show();
    return true;
  }

  function go(step) {
    const place = (keys.indexOf(now.key) + step + keys.length) % keys.length;
    open(keys[place]);
    history.replaceState(null, "", `#view=${encodeURIComponent(now.key)}`);
  }

  $("view").querySelectorAll("option").forEach((option) => {
    if (!keys.includes(option.value)) option.remove();
  });
  $("view").addEventListener("change", ({ target }) => {
    go(keys.indexOf(target.value) - keys.indexOf(now.key));
  });
  $("before").addEventListener("click", () => go(-1));
  $("next").addEventListener("click", () => go(1));
  ["left", "right"].forEach((id, side) => $(id).addEventListener("change", ({ target }) => {
    now.wanted[side] = target.value;
    show();
  }));
  $("region").addEventListener("change", ({ target }) => {
    now.part = Number(target.value);
    show();
  });
  $("arrows").addEventListener("change", show);
  document.querySelectorAll("[data-pair]").forEach((button) => {
    button.addEventListener("click", () => {
      now.wanted = [...pairs[button.dataset.pair]];
      show();
    });
  });
  document.querySelectorAll("[data-mode]").forEach((button) => {
    button.addEventListener("click", () => change(button.dataset.mode));
  });
  document.querySelectorAll("[data-zoom]").forEach((button) => {
    button.addEventListener("click", () => panes.zoom(Number(button.dataset.zoom)));
  });
  document.addEventListener("keydown", (event) => {
    if (event.ctrlKey || event.metaKey || event.altKey) return;
    const own = "select, input, button, summary, a, textarea, video, .scroll";
    if (event.target.closest?.(own)) return;
    if (event.key === "n") go(1);
    else if (event.key === "p") go(-1);
    else if (event.key === " ") {
      event.preventDefault();
      if (now.mode === "blink") {
        stop();
        return flip();
      }
      // The first press shows the right one, as the left is what the eye has just seen.
      now.second = true;
      change("blink");
      stop();
    }
  });
  // Where the difference is seen.
  Object.assign(panes.at, data.opening);
  show();
  return { open, has: (key) => keys.includes(key) };
})();
