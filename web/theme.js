// Light or dark, as the system says: our controls, viser's scene and its floor alike.

const FLOOR = {
  light: { plane_color: [232, 235, 240], cell_color: [212, 216, 224], section_color: [190, 196, 207], shadow_opacity: 0.3 },
  dark: { plane_color: [45, 50, 60], cell_color: [58, 64, 76], section_color: [78, 86, 101], shadow_opacity: 0.55 },
};

import { drawsInSoftware } from "./graphics.js";

export function followTheme($, viewer) {
  const query = matchMedia("(prefers-color-scheme: dark)");
  const apply = () => {
    const theme = query.matches ? "dark" : "light";
    document.documentElement.dataset.teleopTheme = theme;
    $.host.dataset.theme = theme;
    viewer.dark(query.matches);
    viewer.change("/floor", FLOOR[theme]);
  };
  const shadows = !drawsInSoftware();
  query.addEventListener("change", apply);
  viewer.addEventListener("scene", () => {
    apply();
    viewer.shadows(shadows);
  });
  viewer.shadows(shadows);
  apply();
}
