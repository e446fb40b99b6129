// The quality of the picture: where drawing does not keep up, something is left out, step by step,
// until it does.

/** A picture may take this long on average, ms. */
const SLOW = 42;
/** So many pictures are looked at before something is left out, and so much time at least, ms. */
const PICTURES = 4;
const TIME = 800;
/** The level at which everything that can be is left out. */
export const LEAST = 3;

export class Quality {
  level = 0;
  private since = 0;
  private last = 0;
  private pictures = 0;

  /** Nothing is ever left out where `full` says so. */
  constructor(private readonly full: boolean) {}

  /** Begins at a level; says whether that leaves something out. */
  begin(level: number): boolean {
    if (!this.full) this.level = level;
    return this.level > 0;
  }

  /** Counts another picture. Returns true where something more is left out of it. */
  next(): boolean {
    const now = performance.now();
    // A page that was hidden draws nothing, and is not slow.
    if (now - this.last > 3000 || document.hidden) {
      this.since = now;
      this.pictures = 0;
    } else {
      this.pictures += 1;
    }
    this.last = now;
    const over = now - this.since;
    if (this.pictures < PICTURES || over < TIME) return false;
    const each = over / this.pictures;
    this.since = now;
    this.pictures = 0;
    if (this.full || each < SLOW || this.level >= LEAST) return false;
    this.level = Math.min(this.level + (each > 4 * SLOW ? 2 : 1), LEAST);
    return true;
  }
}
