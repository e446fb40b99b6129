// Figures that live. Where the page that needs no program stands beside the book (in live/, built by
// `npm run build:static -- ../target/book/live` in web/), a picture whose address ends in
// #live=SCENE becomes that cloth, to be taken hold of, as soon as it is seen.
(() => {
  const root = typeof path_to_root === "undefined" ? "" : path_to_root;
  const pictures = [...document.querySelectorAll('img[src*="#live="]')];

  function revive(picture) {
    const figure = document.createElement("iframe");
    figure.src = `${root}live/index.html?figure&scene=${new URL(picture.src).hash.slice("#live=".length)}`;
    figure.title = picture.alt;
    figure.style = `width: 100%; border: 0; aspect-ratio: ${picture.naturalWidth || 16} / ${picture.naturalHeight || 9}`;
    picture.replaceWith(figure);
  }

  async function start() {
    // A book without it keeps its pictures.
    const answer = await fetch(`${root}live/index.html`, { method: "HEAD" }).catch(() => null);
    if (!answer?.ok) return;
    const seen = new IntersectionObserver((entries) => {
      for (const { target, isIntersecting } of entries) {
        if (!isIntersecting) continue;
        seen.unobserve(target);
        revive(target);
      }
    });
    pictures.forEach((picture) => seen.observe(picture));
  }

  if (pictures.length > 0) start();
})();
