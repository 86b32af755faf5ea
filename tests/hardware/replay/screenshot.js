// SPDX-License-Identifier: BSD-3-Clause
// node screenshot.js <replay.html> <picture.png> <time> [<azimuth> <elevation> <distance factor> <width> <height>]
// The pictures of README.md and docs/gallery.md: docs/replay.md and scripts/gallery.sh say how they are made.
const { pathToFileURL } = require("url");
const { open } = require("./page.js");

(async () => {
  const [file, picture, time, azimuth, elevation, nearer, width, height] = process.argv.slice(2);
  const { browser, page, errors } = await open(pathToFileURL(file).href, {
    width: Number(width || 1500), height: Number(height || 1020),
  });
  await page.evaluate(([t, a, e, d]) => {
    if (a) window.replay.orbit.azimuth = a;
    if (e) window.replay.orbit.elevation = e;
    if (d) window.replay.orbit.distance *= d;
    window.replay.seek(t);
    // What the foot of the page would cut is left out.
    const foot = document.querySelector("footer").getBoundingClientRect().top;
    for (const card of document.querySelectorAll(".plot")) {
      if (card.getBoundingClientRect().bottom > foot) card.style.visibility = "hidden";
    }
  }, [time, azimuth, elevation, nearer].map(Number));
  await page.screenshot({ path: picture });
  await browser.close();
  for (const error of errors) console.error(error);
  process.exit(errors.length ? 1 : 0);
})();
