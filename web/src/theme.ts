// The two themes of the page: the colours of the room, of its cloths and of their handles.

import * as three from "three";

/** The colours of the two sides of a cloth: by day those of pictures, `FRONT` and `BACK` of
 * `crates/selvedge-view/src/raster/shade.rs`. */
export interface Look {
  front: three.Color;
  back: three.Color;
}

/** The colours and the light of the room. */
export interface Theme {
  background: string;
  /** The floor where the light falls, and its lines. */
  floor: string;
  grid: string;
  lines: string;
  handle: string;
  /** Obstacles. */
  body: string;
  looks: [Look, Look];
  /** Darkness of shadows on the floor, 0 to 1. */
  shadow: number;
  exposure: number;
}

const colour = (text: string) => new three.Color(text);

export const THEMES: Record<"light" | "dark", Theme> = {
  light: {
    background: "#e6e2db",
    floor: "#f6f3ee",
    grid: "#b9b1a4",
    lines: "#1c2733",
    handle: "#d1495b",
    body: "#aaa8a5",
    looks: [
      { front: colour("#3a609e"), back: colour("#d6c2a0") },
      { front: colour("#4e8368"), back: colour("#d6c2a0") },
    ],
    shadow: 0.26,
    exposure: 1.05,
  },
  dark: {
    background: "#14171c",
    floor: "#272c35",
    grid: "#4a5361",
    lines: "#e6edf5",
    handle: "#ff6b7d",
    body: "#6d7683",
    looks: [
      { front: colour("#5b86c4"), back: colour("#d6c2a0") },
      { front: colour("#63a585"), back: colour("#d6c2a0") },
    ],
    shadow: 0.6,
    exposure: 0.95,
  },
};
