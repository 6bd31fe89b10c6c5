// The cameras in space, drawn anew from each side.
(() => {
  const svg = $("rig"), rig = data.rig, SVG = "http://www.w3.org/2000/svg";
  // Half the drawing, less a margin; angles by one key, and by its whole width.
  const HALF = [92, 68], STEP = 0.1, TURN = 4;
  const start = { yaw: 0.5, pitch: 0.5, zoom: 1 };
  const eye = { ...start };
  const level = new Map(data.photos.map((one) => [`${one.split}/${one.name}`, one]));
  // All cameras, and most of the points, are seen at the start.
  const fitted = [...rig.cameras.flat(), ...most(rig.points.places)];
  const pivot = [0, 1, 2].map((k) => middle(fitted.map((place) => place[k])));

  function most(places) {
    const ends = [0, 1, 2].map((k) => {
      const sorted = places.map((place) => place[k]).sort((a, b) => a - b);
      return [0.2, 0.8].map((share) => sorted[Math.floor(share * sorted.length)]);
    });
    return places.filter((p) => p.every((at, k) => at >= ends[k][0] && at <= ends[k][1]));
  }

  function middle(values) {
    const [least, largest] = values.reduce(
      ([a, b], value) => [Math.min(a, value), Math.max(b, value)], [Infinity, -Infinity],
    );
    return (least + largest) / 2;
  }

  // A function from places to places in the drawing, in units of length.
  function flatten() {
    const [cy, sy] = [Math.cos(eye.yaw), Math.sin(eye.yaw)];
    const [cp, sp] = [Math.cos(eye.pitch), Math.sin(eye.pitch)];
    return (place) => {
      const [x, y, z] = place.map((at, k) => at - pivot[k]);
      return [cy * x - sy * z, sp * (sy * x + cy * z) - cp * y];
    };
  }

  const first = fitted.map(flatten());
  const centre = [0, 1].map((k) => middle(first.map((place) => place[k])));
  const across = first.reduce((most, place) => (
    Math.max(most, ...place.map((at, k) => Math.abs(at - centre[k]) / HALF[k]))
  ), 1e-9);

  function add(parent, name, attributes) {
    const made = document.createElementNS(SVG, name);
    Object.entries(attributes).forEach(([key, value]) => made.setAttribute(key, value));
    parent.append(made);
    return made;
  }

  const colours = new Map();
  rig.points.colours.forEach((colour, i) => {
    // Few colours, so that few paths are drawn.
    const name = `rgb(${colour.map((byte) => 36 * Math.round(byte / 36)).join()})`;
    colours.set(name, [...(colours.get(name) ?? []), rig.points.places[i]]);
  });
  const clouds = [...colours].map(([stroke, places]) => (
    { path: add(svg, "path", { class: "point", stroke }), places }
  ));
  const cameras = rig.names.map((name, i) => {
    const key = `${rig.splits[i]}/${name}`, photo = level.get(key);
    const words = photo?.px == null ? "not measured" : `${photo.px.toFixed(1)} px`;
    const group = add(svg, look?.has(key) ? "a" : "g", {
      class: `camera ${photo?.level ?? "unknown"} ${rig.splits[i]}`,
      href: `#view=${encodeURIComponent(key)}`, tabindex: -1,
    });
    add(group, "title", {}).textContent = `${name}: ${words}`;
    return {
      path: add(group, "path", {}), hit: add(group, "circle", { r: 2.5 }), body: rig.cameras[i],
      arrow: rig.arrows[i] && add(svg, "path", { class: "arrow" }), ends: rig.arrows[i],
    };
  });

  // Right, up, towards the viewer, from the lower left corner.
  const axes = ["#d33", "#2a4", "#36d"].map((stroke) => add(svg, "path", { class: "axis", stroke }));

  function draw() {
    const seen = flatten(), size = eye.zoom / across;
    axes.forEach((axis, k) => {
      const [x, y] = seen(pivot.map((at, i) => at + (i === k ? 9 : 0)));
      axis.setAttribute("d", `M-86 62l${x.toFixed(2)} ${y.toFixed(2)}`);
    });
    const flat = (place) => seen(place).map((at, k) => (size * (at - centre[k])).toFixed(1)).join(" ");
    for (const { path, places } of clouds) {
      path.setAttribute("d", places.map((place) => `M${flat(place)}h0`).join(""));
    }
    for (const { path, hit, body, arrow, ends } of cameras) {
      const [eyed, a, b, c, d] = body.map(flat);
      const [x, y] = flat(body[0].map((_, k) => (body[1][k] + body[3][k]) / 2)).split(" ");
      hit.setAttribute("cx", x);
      hit.setAttribute("cy", y);
      path.setAttribute("d", `M${a}L${b}L${c}L${d}ZM${eyed}L${a}M${eyed}L${b}`
        + `M${eyed}L${c}M${eyed}L${d}M${a}L${eyed}L${b}Z`);
      if (arrow) arrow.setAttribute("d", tipped(...ends.map((end) => flat(end).split(" "))));
    }
  }

  function tipped(from, to) {
    const [x, y] = to.map(Number), [dx, dy] = [x - from[0], y - from[1]];
    const length = Math.hypot(dx, dy) || 1, head = Math.min(2.5, length / 2);
    const [u, v] = [head * dx / length, head * dy / length];
    return `M${from.join(" ")}L${x} ${y}M${x - u - v / 2} ${y - v + u / 2}L${x} ${y}`
      + `L${x - u + v / 2} ${y - v - u / 2}`;
  }

  function turn(yaw, pitch) {
    eye.yaw += yaw;
    eye.pitch = Math.min(Math.max(eye.pitch + pitch, -Math.PI / 2), Math.PI / 2);
    draw();
  }

  function zoom(times) {
    eye.zoom = Math.min(Math.max(eye.zoom * times, 0.2), 20);
    draw();
  }

  let held = null, dragged = 0;
  svg.addEventListener("pointerdown", (event) => {
    held = [event.clientX, event.clientY];
    dragged = 0;
  });
  svg.addEventListener("pointermove", (event) => {
    if (!held || !event.buttons) return;
    const now = [event.clientX, event.clientY];
    const [dx, dy] = [now[0] - held[0], now[1] - held[1]];
    dragged += Math.hypot(dx, dy);
    // Captured earlier, a click would not reach the camera under it.
    if (dragged > 4) svg.setPointerCapture(event.pointerId);
    held = now;
    const width = svg.getBoundingClientRect().width;
    turn(TURN * dx / width, TURN * dy / width);
  });
  svg.addEventListener("pointerup", () => { held = null; });
  // The end of a drag opens no photo.
  svg.addEventListener("click", (event) => {
    if (dragged > 4) {
      event.preventDefault();
      event.stopPropagation();
    }
  }, true);
  svg.addEventListener("wheel", (event) => {
    if (!event.ctrlKey && document.activeElement !== svg) return;
    event.preventDefault();
    zoom(2 ** (-event.deltaY / 300));
  }, { passive: false });
  svg.addEventListener("dblclick", () => {
    Object.assign(eye, start);
    draw();
  });
  svg.addEventListener("keydown", (event) => {
    const turns = {
      ArrowLeft: [-STEP, 0], ArrowRight: [STEP, 0], ArrowUp: [0, -STEP], ArrowDown: [0, STEP],
    };
    if (turns[event.key]) turn(...turns[event.key]);
    else if (event.key === "+" || event.key === "=") zoom(1.25);
    else if (event.key === "-") zoom(0.8);
    else return;
    event.preventDefault();
  });
  draw();
})();
