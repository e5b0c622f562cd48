"""What a conversion would do, without doing it."""

from __future__ import annotations

from pathlib import Path
from typing import TYPE_CHECKING, Any

if TYPE_CHECKING:
    from vid2ev.cost.front import Budget
    from vid2ev.seen.recipe import Recipe
    from vid2ev.tracks.outputs import Outputs

MANNER = ("device", "threads", "overwrite", "resume", "skip", "effects", "tolerance", "notes")  # no part of a recipe


def planned(
    video: str, directory: Path, options: dict[str, Any], budget: Budget | None = None
) -> tuple[dict[str, Any], str]:
    """The recipe for programs, and lines for people; raises what the conversion would raise before its first frame."""
    from vid2ev.commands import summary
    from vid2ev.cores import usable_cores
    from vid2ev.making import conversion
    from vid2ev.plan import recordings
    from vid2ev.recording.folder import taken_up
    from vid2ev.sensors.devices import device_for
    from vid2ev.terminal import lines
    from vid2ev.tracks import recorder

    recipe, outputs = checked(video, directory, options, budget)
    effects, tolerance = options["effects"], options["tolerance"]
    device, threads, resume = options["device"], options["threads"], options["resume"]
    recipe, plans = (recipe, {}) if effects == "auto" else recordings.planned(recipe, effects, tolerance)
    described = recipe.describe() | recordings.described(plans)
    if options["seed"] is None:
        described |= {"seed": conversion.begun_seed(directory, resume, "drawn at random")}
    finished = False
    if resume and (budget is None or "notes" in options):  # (what was tried is not known otherwise)
        asked = tolerance if effects == "auto" else None
        job = conversion.job_of(recipe, outputs, asked, plans, options.get("notes"))
        finished = taken_up(directory, job, options["overwrite"]) == directory / "manifest.json"
    truth = ["truth"] * (recipe.truth is not None)
    files = [f"{mount.within}{name}" for mount in recipe.mounts for name in [*outputs.names(mount.kind), *truth]]
    files += [] if recipe.alone else [*recorder.rig_files(recipe), "manifest.json"]
    facts = summary.recipe_facts(described)
    if effects == "auto":
        facts.append(("plan", f"of all effects those that the light calls for, within {tolerance:g}"))
    facts.append(("output", f"{directory}: {'finished, and left as it is' if finished else ', '.join(files)}"))
    facts += summary.device_facts(device_for(device, recipe.work, threads or usable_cores()).describe())
    text = lines([*facts, *([("threads", str(threads))] if threads else [])])
    return described | {"outputs": outputs.describe()}, text


def checked(video: str, directory: Path, options: dict[str, Any], budget: Budget | None) -> tuple[Recipe, Outputs]:
    """The recipe and the outputs of a conversion; raises what it would raise before it looks at the light."""
    from vid2ev.making import conversion
    from vid2ev.plan import recordings
    from vid2ev.recording.folder import check_free
    from vid2ev.seen.recipe import Recipe
    from vid2ev.tracks.outputs import Outputs

    rest = {name: value for name, value in options.items() if name not in MANNER}
    outputs = Outputs.of(**Outputs.taken_from(rest))
    if rest["seed"] is None:
        rest["seed"] = conversion.begun_seed(directory, options["resume"], 0)
    recipe = Recipe.of(video, **rest)
    if budget is not None:
        budget.check({mount.kind for mount in recipe.mounts})
    recordings.check_effects(options["effects"], options["tolerance"])
    conversion.check_outputs(recipe, outputs)
    check_free(directory, options["overwrite"], options["resume"], video)
    if options["resume"]:
        conversion.check_twice(recipe)
    return recipe, outputs
