// Addresses of photos, texts to copy, and what is printed.
(() => {
  const VIEW = "#view=";

  // A name may hold a `%` that begins nothing.
  function key(address) {
    try {
      return decodeURIComponent(address.slice(VIEW.length));
    } catch {
      return address.slice(VIEW.length);
    }
  }

  function follow(address) {
    if (!look || !address.startsWith(VIEW) || !look.open(key(address))) return false;
    $("look").scrollIntoView({ block: "start" });
    return true;
  }

  document.addEventListener("click", (event) => {
    const link = event.target.closest?.(`a[href^="${VIEW}"]`);
    const address = link?.getAttribute("href");
    if (!address || event.ctrlKey || event.metaKey || event.shiftKey) return;
    event.preventDefault();
    if (follow(address)) history.replaceState(null, "", address);
  });
  addEventListener("hashchange", () => follow(location.hash));

  async function copy(button) {
    const { copy: text } = button.dataset, before = button.textContent;
    try {
      await navigator.clipboard.writeText(text);
    } catch {
      const area = document.createElement("textarea");
      area.value = text;
      document.body.append(area);
      area.select();
      document.execCommand("copy");
      area.remove();
    }
    button.textContent = "Copied";
    setTimeout(() => { button.textContent = before; }, 1500);
  }

  document.querySelectorAll(".copy").forEach((button) => {
    button.addEventListener("click", () => copy(button));
  });

  document.querySelectorAll("[data-photo]").forEach((one) => {
    one.setAttribute("href", data.images[one.dataset.photo].photo);
  });

  $("trainer")?.addEventListener("change", ({ target }) => {
    document.querySelectorAll("[data-trainer]").forEach((one) => {
      one.hidden = one.dataset.trainer !== target.value;
    });
  });

  // From the table of all photos to the images of one.
  document.querySelectorAll("#views tbody tr").forEach((row) => {
    const [name, split] = [...row.cells].map((cell) => cell.textContent);
    if (!look?.has(`${split}/${name}`)) return;
    const link = document.createElement("a");
    link.href = VIEW + encodeURIComponent(`${split}/${name}`);
    link.textContent = name;
    row.cells[0].replaceChildren(link);
  });

  // An address into a part that is folded opens it.
  function unfold() {
    const found = location.hash.startsWith(VIEW) ? null : $(location.hash.slice(1));
    const folded = found?.closest("details");
    if (folded) folded.open = true;
  }

  addEventListener("hashchange", unfold);
  unfold();
  follow(location.hash);
})();
