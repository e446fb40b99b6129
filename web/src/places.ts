// Places on the screen, in pixels: of labels, and of the vertex that is nearest to a pointer.

export interface Place {
  x: number;
  y: number;
}

/** From the top of a cloth up to its label, and from one label to the one above it. */
const LIFT = 16;
const HEIGHT = 30;
/** Labels stay below the meters. */
const TOP = 80;

/**
 * The place of the label of a cloth whose top is at `top`. Where cloths lie one over the other, it
 * stands above `before`, the label of the cloth before; at the upper edge below it.
 */
export function labelPlace(top: Place, before?: Place): Place {
  if (!before) return { x: top.x, y: Math.max(top.y - LIFT, TOP) };
  const above = before.y - HEIGHT;
  return { x: before.x, y: above >= TOP ? above : before.y + HEIGHT };
}

/** The index of the place nearest to `at` and nearer than `reach`; -1 where there is none. */
export function nearest(places: Iterable<Place>, at: Place, reach: number): number {
  let best = -1;
  let least = reach;
  let index = 0;
  for (const place of places) {
    const distance = Math.hypot(place.x - at.x, place.y - at.y);
    if (distance < least) {
      least = distance;
      best = index;
    }
    index += 1;
  }
  return best;
}
