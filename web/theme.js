// Light or dark, as the system says: our controls, viser's scene and its floor alike.

const FLOOR = {
  light: { plane_color: [232, 235, 240], cell_color: [212, 216, 224], section_color: [190, 196, 207], shadow_opacity: 0.3 },
  dark: { plane_color: [67, 73, 86], cell_color: [80, 87, 101], section_color: [98, 106, 122], shadow_opacity: 0.5 },
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
