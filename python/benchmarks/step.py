"""The price of a step from Python, at 400 vertices.

    python benchmarks/step.py [repeats]

Two steppers go through the same motion from the same start, ten steps in turn: one is stepped from
Python, the other by one call of the library, which drives it in Rust (`follow`). Of each ten steps
the shortest time of all repeats counts, so that other work of the machine does not. A step of
almost nothing shows what a call costs, and ten hours of such frames what happens to memory.

With RAYON_NUM_THREADS=1 the processor's time is counted instead of the clock's: on a machine that is
busy with other things that is the only one that says something.
"""

import os
import resource
import sys
import time

import selvedge

WINDOWS = 8
STEPS = 10
TEN_HOURS = 10 * 3600 * 60


ONE_THREAD = os.environ.get("RAYON_NUM_THREADS") == "1"
CLOCK = time.process_time if ONE_THREAD else time.perf_counter


def timed(work):
    began = CLOCK()
    work()
    return CLOCK() - began


def windows(make, scene):
    """Times of each ten steps from Python and in Rust [s], (windows, 2)."""
    by_hand, driven = make(), make()
    by_hand.step(), driven.step()
    samples, times = len(by_hand.next_targets()), []
    for window in range(WINDOWS):
        first = 1 + STEPS * window
        targets = [scene.targets(frame, samples) for frame in range(first, first + STEPS)]

        def step_all():
            for target in targets:
                by_hand.step(target)

        times.append((timed(step_all), timed(lambda: driven.follow(STEPS))))
    assert (by_hand.positions == driven.positions).all()
    return times


def main():
    repeats = int(sys.argv[1]) if len(sys.argv) > 1 else 8
    scene, model = selvedge.Scene("default"), selvedge.Model("paper")
    scene.rest_pose()
    makers = {
        "physics": lambda: selvedge.Simulator(scene),
        "model": lambda: selvedge.LearnedStepper(scene, model),
        "model, guarded": lambda: selvedge.LearnedStepper(scene, model, guard="limit"),
    }
    print("processor time, one thread" if ONE_THREAD else "time on all threads")
    print(f"{len(scene.positions)} vertices, {WINDOWS} times {STEPS} steps, {repeats} repeats")
    for name, make in makers.items():
        every = [windows(make, scene) for _ in range(repeats)]
        least = [[min(run[k][who] for run in every) for k in range(WINDOWS)] for who in (0, 1)]
        python, rust = (1e3 * sum(times) / (WINDOWS * STEPS) for times in least)
        price = 100 * (python / rust - 1)
        print(f"{name:18} Rust {rust:.3f} ms, Python {python:.3f} ms per step: {price:+.1f} %")
    rigid = selvedge.RigidStepper(scene)
    rigid.step()
    target = scene.targets(1)
    empty = timed(lambda: [rigid.step(target) for _ in range(10_000)]) / 10_000
    print(f"a step of almost nothing (a rigid cloth): {1e6 * empty:.2f} µs")
    before = resource.getrusage(resource.RUSAGE_SELF).ru_maxrss
    for _ in range(TEN_HOURS):
        rigid.step(target)
    after = resource.getrusage(resource.RUSAGE_SELF).ru_maxrss
    peaks = f"{before / 1024:.1f} MB before, {after / 1024:.1f} MB after"
    print(f"largest memory over {TEN_HOURS:,} steps, ten hours of frames: {peaks}")


if __name__ == "__main__":
    main()
