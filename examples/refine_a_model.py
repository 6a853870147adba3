"""A place has changed since its scan: the model is refined by a new survey, and a new arena is made of it."""

import reconstruction as rc
import symbrion_gym as sg

before, now = sg.Course(pit=0.35), sg.Course(pit=0.45)


def main() -> list[float]:
    """Return how far 95 % of the place as it is now are from the model, before and after the second survey [mm]."""
    model = rc.reconstruct(rc.preprocess(sg.survey(before, seed=0)), units=2200, seed=0)
    refined = model.refine(sg.survey(now, seed=1), seed=0)
    arena = sg.make_arena(refined)
    qualities = (each.quality(truth=now.surface()) for each in (model, refined))
    errors = [1000 * quality.truth_to_mesh.p95 for quality in qualities]
    print(f"model before {errors[0]:.1f} mm, refined {errors[1]:.1f} mm; {len(arena.pieces)} pieces touch")
    return errors


if __name__ == "__main__":
    main()
