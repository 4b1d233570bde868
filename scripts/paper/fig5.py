"""Fig. 5: map, anchors with errors and room boundaries; static tags; the walk."""

from __future__ import annotations

import numpy as np

from slam_uwb import Settings, evaluate_solution, simulate_survey, solve_survey
from slam_uwb.positioning import locate_stays, track_tag
from slam_uwb.report import draw_solution, draw_static_tags, draw_walk, figure_png
from slam_uwb.simulate import simulate_static_tags, simulate_walk

from .experiment import METHODS, SCENE, anchors_of
from .run import Run, Section


def make(run: Run) -> Section:
    """One survey of full recordings, solved jointly and sequentially."""
    seed = run.seeds[0]
    made = simulate_survey(SCENE, seed)
    solutions = {name: solve_survey(made.survey, METHODS[name]) for name in ("joint", "sequential")}
    joint = solutions["joint"]
    pose = evaluate_solution(joint, made.reference).reference_T_world
    for name, solution in solutions.items():
        figure = draw_solution(solution, reference=made.reference)
        plan = solution.plan
        for k, room in enumerate(() if plan is None else plan.rooms):
            corners = np.vstack([room.polygon, room.polygon[:1]])
            label = "room, of the upper scans" if k == 0 else "_nolegend_"
            figure.axes[0].plot(*corners.T, color="#555555", linewidth=2.5, label=label, zorder=2)
        # The legend was made before the rooms were drawn.
        for legend in figure.legends:
            legend.remove()
        figure.legend(loc="outside lower center", ncols=3, fontsize=8, frameon=False)
        run.write(f"fig5a-{name}.png", figure_png(figure))
    if pose is None:
        return Section("Fig. 5", "The survey could not be brought into the reference's frame.\n")
    settings = Settings().positioning
    static, walk = simulate_static_tags(made.scene, seed), simulate_walk(made.scene, seed)
    # Everything is drawn in the map's frame.
    world_T_reference = pose.inverse()
    located, tracks, anchors = {}, {}, {}
    for name in ("reference", "joint", "sequential"):
        found = anchors_of(made, solutions.get(name))
        if found is None:
            continue
        places, frame = found
        world = world_T_reference @ frame
        stays = locate_stays(static.recording, places, settings)
        label = f"{name} anchors"
        located[label] = {
            s.id: world.transform(s.position) for s in stays if s.position is not None
        }
        heard = walk.recording
        track = track_tag(heard.epochs, places, heard.tag_height, settings, heard.power_law)
        tracks[label] = world.transform(track.places)
        anchors[label] = world.transform(np.array([p[:2] for p in places.values()]))
    truth = {n: world_T_reference.transform(p) for n, p in static.truth.places.items()}
    figure = draw_static_tags(f"static tags, {made.survey.name}", truth, located, joint.floor_map)
    run.write("fig5b.png", figure_png(figure))
    path = None if walk.truth.path is None else world_T_reference.transform(walk.truth.path)
    figure = draw_walk(f"the walk, {made.survey.name}", path, tracks, joint.floor_map, anchors)
    run.write("fig5c.png", figure_png(figure))
    text = (
        f"Seed {seed}, recordings of one minute and raised ones of ten seconds. Crosses are the true anchors, "
        "lines their errors; dark lines the room boundaries, found with the upper scans.\n\n"
        "![5a, joint](fig5a-joint.png)\n![5a, sequential](fig5a-sequential.png)\n\n"
        f"Static tags ({len(truth)} places) and a walk of {len(walk.recording.epochs) / 2:.0f} s, the same "
        "measurements located with each set of anchors:\n\n![5b](fig5b.png)\n![5c](fig5c.png)\n"
    )
    return Section("Fig. 5: the experiment", text)
