"""Section 5 of docs/paper.md: what the published stiffnesses say about the published model."""

from __future__ import annotations

from dataclasses import replace
from itertools import product

import numpy as np
from scipy.optimize import minimize

from benchmarks.paper_model import (
    FORCE_N,
    POSITION,
    PRIORS,
    SENSOR_M,
    SETS,
    TABLE_1,
    TABLE_2,
    TOOL,
    Design,
    World,
    fit,
    fit_sets,
    frames,
    lever,
    make_design,
    one_step,
    orientations,
    readings,
    serial_angles,
    truths,
)
from benchmarks.paper_page import EVERYTHING, factor, table, text, validation_errors

WORLDS = {
    "(a) 1 µm noise as stated, model exact": World(at_equilibrium=False),
    "(a) the same, torque at equilibrium": World(),
    "(b) noise 10 µm": World(noise_m=10e-6),
    "(b) noise 50 µm": World(noise_m=50e-6),
    "(b) re-seating 20 µm an orientation": World(reseating_m=20e-6),
    "(b) force error 5 % a reading": World(force_noise=0.05),
    "(d) springs at the drives, rod (`drive`)": World(rod=True),
    "(e) base rocks and shifts": World(base=1.0),
    "(e) force sensor and spindle yield": World(spindle=1.0),
    "(e) force direction off by 1-2°": World(misalignment_deg=(1.0, 2.0)),
    "(e) side load 2-5 %": World(side_load=(0.02, 0.05)),
    "(e) backlash, free play 0.1-1 arcmin": World(backlash_arcmin=(0.05, 0.5)),
    "(e) load up to 10 mm beside the TCP": World(tool_mm=10.0),
    "all of (e), 10 µm noise, 20 µm re-seating, 2 % force error": EVERYTHING,
    "the same and the rod": replace(EVERYTHING, rod=True),
}


def ratios(found: dict[str, np.ndarray]) -> np.ndarray:
    """(S, 4): k6, k1, k3 of Y against all, k3 of X against Y."""
    return np.stack([factor(found["Y"][:, 5], found["all"][:, 5]), factor(found["Y"][:, 0], found["all"][:, 0]),
                     factor(found["Y"][:, 2], found["all"][:, 2]), factor(found["X"][:, 2], found["Y"][:, 2])], axis=1)


PUBLISHED_SETS = {name: k[None] for name, k in TABLE_2.items()}
PUBLISHED = ratios(PUBLISHED_SETS)[0]


def y_disagreement(design: Design, found: dict[str, np.ndarray]) -> np.ndarray:
    """How far the predictions of Y and all are apart over the Y readings, both of them fitted to these (S,) [µm], RMS."""
    rows = design.rows("Y")
    eta = [one_step(design.theta[rows], design.force[rows], 1 / found[name], design.tool)[0] for name in ("Y", "all")]
    return 1e6 * np.sqrt(np.mean(np.sum((eta[0] - eta[1]) ** 2, axis=2), axis=1))


def spread(values: np.ndarray) -> str:
    """Median (5-95 %)."""
    low, middle, high = (f"{value:.2f}" if value < 10 else f"{value:.0f}" if value < 1000 else "> 1000"
                         for value in np.percentile(values, [5, 50, 95]))
    return f"{middle} ({low}-{high})"


def ratio_row(name: str, seen: np.ndarray, apart: np.ndarray, last: str) -> list[str]:
    """One row of section 5."""
    share = [np.mean(seen[:, 0] >= 0.99 * PUBLISHED[0]), np.mean(np.all(seen >= 0.99 * PUBLISHED, axis=1))]
    return [name, *(spread(column) for column in seen.T), spread(apart), *(f"{100 * value:.0f} %" for value in share), last]


def disagreement() -> list[str]:
    """What the published sets predict of the same Y readings, over TCP positions and tools."""
    rows = []
    for beside in (0.1, 0.3, 0.4, 0.5, 0.6, 0.8):
        closest, third, middle = np.inf, np.inf, []
        for x, y, z, ahead in product((1.2, 1.4, 1.6, 1.8), (0.0, 0.4), (0.5, 0.8, 1.1), (0.1, 0.3, 0.5)):
            tool = np.array([beside, 0.0, ahead])
            theta = orientations(np.array([x, y, z]), tool, 500, np.random.default_rng(9))
            if len(theta) < 20:
                continue
            force = np.tile([0.0, FORCE_N, 0.0], (len(theta), 1))
            eta = [one_step(theta, force, 1 / TABLE_2[data][None], tool)[0][0] for data in ("Y", "all")]
            apart = np.sort(1e6 * np.linalg.norm(eta[0] - eta[1], axis=1))
            closest, third = min(closest, apart[0]), min(third, apart[2])
            middle.append(np.median(apart))
        rows.append([f"{1e3 * beside:.0f}", f"{np.median(middle):.0f}", f"{closest:.0f}", f"{third:.0f}"])
    return table(["TCP beside the flange axis [mm]", "median [µm]", "smallest anywhere",
                  "smallest third of one position and tool"], rows)


def stopped_early(design: Design, name: str, world: World, options: tuple[str, int, float], count: int = 60) -> list[str]:
    """(c): first-order model, solver in raw k (10⁶ N m/rad): method, most iterations, factor on the cost."""
    method, iterations, scale = options
    rng = np.random.default_rng(42)
    z = readings(design, truths(count, rng), world, rng)
    columns = lever(*frames(serial_angles(design.theta), design.tool)[:3])
    shape = columns * np.einsum("nic,nc->ni", columns, design.force)[..., None]
    start = TABLE_1 / 1e6

    def solve(rows: np.ndarray, reading: np.ndarray) -> np.ndarray:
        matrix = shape[rows].transpose(0, 2, 1).reshape(-1, 6) / SENSOR_M / 1e6
        wanted = reading[rows].ravel() / SENSOR_M

        def cost(k: np.ndarray) -> tuple[float, np.ndarray]:
            residual, off = matrix @ (1 / k) - wanted, k - start
            return 0.5 * scale * float(residual @ residual + off @ off), scale * (off - (matrix.T @ residual) / k**2)

        return minimize(cost, start, jac=True, method=method, bounds=[(1e-3, None)] * 6, options={"maxiter": iterations}).x

    found = {data: 1e6 * np.array([solve(design.rows(data), reading) for reading in z]) for data in SETS}
    return ratio_row(f"(c) {name}", ratios(found), y_disagreement(design, found), "")


def close_orientations(degrees: float, count: int = 20) -> list[Design]:
    """(f): random designs whose Y orientations lie within so many degrees of the in-plane one they share with X."""
    rng = np.random.default_rng(4)
    in_plane = orientations(POSITION, TOOL, 400, rng, in_plane=True)
    free = orientations(POSITION, TOOL, 20000, rng)
    turned = frames(serial_angles(free), TOOL)[3]
    force = np.zeros((5, 3))
    force[:3, 1], force[3:, 0] = FORCE_N, FORCE_N
    designs: list[Design] = []
    while len(designs) < count:
        first, second = rng.choice(len(in_plane), 2, replace=False)
        trace = np.einsum("ij,nij->n", frames(serial_angles(in_plane[first]), TOOL)[3], turned)
        near = np.flatnonzero(trace > 1 + 2 * np.cos(np.radians(degrees)))
        if len(near) >= 2:
            others = free[rng.choice(near, 2, replace=False)]
            theta = np.array([in_plane[first], *others, in_plane[first], in_plane[second]])
            designs.append(Design(theta, force, np.array([0, 1, 2, 0, 3]), TOOL))
    return designs


def pooled_row(name: str, designs: list[Design], world: World, robots: int = 20) -> list[str]:
    """One row of section 5 over several designs."""
    rng = np.random.default_rng(44)
    seen, apart = [], []
    for design in designs:
        found = fit_sets(design, readings(design, truths(robots, rng), world, rng), PRIORS["equal"])
        seen.append(ratios(found))
        apart.append(y_disagreement(design, found))
    return ratio_row(name, np.concatenate(seen), np.concatenate(apart), "")


def other_minima(design: Design, world: World, count: int = 60) -> str:
    """How often converged fits from Table 2's own values and from other starts end elsewhere."""
    rng, parts = np.random.default_rng(43), []
    z = readings(design, truths(count, rng), world, rng)
    for data in SETS:
        rows = design.rows(data)
        arguments = (design.theta[rows], design.force[rows], z[:, rows], design.tool, PRIORS["equal"])
        reference, least = fit(*arguments, steps=400)
        elsewhere = []
        for start in (TABLE_2[data], *(TABLE_1 * np.exp(1.5 * rng.standard_normal(6)) for _ in range(5))):
            k, cost = fit(*arguments, start=start, steps=400)
            elsewhere.append((factor(k, reference).max(axis=1) > 1.05) & (np.abs(cost - least) > 1e-6 * least))
        parts.append(f"{data} {100 * np.mean(elsewhere):.1f} %")
    return ", ".join(parts)


def world_row(design: Design, name: str, world: World, prior: str = "equal", count: int = 200) -> list[str]:
    """One kind of simulated robot in section 5."""
    rng = np.random.default_rng(41)
    k = truths(count, rng)
    found = fit_sets(design, readings(design, k, world, rng), PRIORS[prior])
    errors = {data: np.sum(value**2, axis=1) for data, value in validation_errors(found, k, world, rng).items()}
    return ratio_row(name, ratios(found), y_disagreement(design, found), f"{100 * np.mean(errors['Y'] < errors['all']):.0f} %")


def section_published() -> list[str]:
    """Section 5."""
    design = make_design(True)
    untrue = replace(EVERYTHING, rod=True)
    rows = [["**published, Table 2**", *(f"**{value:.1f}**" for value in PUBLISHED),
             f"**{y_disagreement(design, PUBLISHED_SETS)[0]:.0f}**", "", "", ""]]
    rows += [world_row(design, name, world) for name, world in WORLDS.items()]
    rows.append(world_row(make_design(True, "relative"), 'the same, design and fit with prior "relative"', untrue, "relative"))
    rows += [stopped_early(design, *arguments) for arguments in (
        ("SQP with BFGS (SLSQP), default stop, data as (a)", World(), ("SLSQP", 1000, 1.0)),
        ("the same, all effects and the rod", untrue, ("SLSQP", 1000, 1.0)),
        ("the same, cost scaled by 10⁻³, data as (a)", World(), ("SLSQP", 1000, 1e-3)),
        ("the same, by 10⁻⁶, 10 iterations, data as (a)", World(), ("SLSQP", 10, 1e-6)),
        ("L-BFGS-B to convergence, data as (a)", World(), ("L-BFGS-B", 15000, 1.0)))]
    searched, close, closer, random = ([make_design(True, seed=seed) for seed in range(20)], close_orientations(20),
                                       close_orientations(10), close_orientations(180))
    rows += [pooled_row(*arguments) for arguments in (
        ("(f) 20 searched designs, data as (a)", searched, World()),
        ("(f) 20 searched designs, all effects and the rod", searched, untrue),
        ("(f) random orientations, all effects and the rod", random, untrue),
        ("(f) Y orientations within 20°, all effects and the rod", close, untrue),
        ("(f) Y orientations within 10°, data as (a)", closer, World()),
        ("(f) Y orientations within 10°, all effects and the rod", closer, untrue))]
    return [
        "## 5. What Table 2 says about the published model", "",
        *text("""
            X-only k1, k4, k6 are the prior: no evidence, as it should be. Odd: Y-only and all differ 31.6 times in k6, 3.1
            in k1, 2.6 in k3, although all is Y plus two X readings that say nothing of joint 6; and X and Y differ 4.1
            times in k3."""),
        *text("""
            Simulated: in-plane design, eq. 12 with Σ = (1 µm)², prior "equal", from Table 1 to convergence; 200 robots a
            row, 60 in (c), 20 designs of 20 robots in (f). Where SLSQP ends depends on the processor's rounding; its rows
            hold as to size. Factors between the sets, median (5-95 %). "Y readings": how far the predictions of the Y set
            and the all set are apart over the three Y readings both were fitted to, RMS in µm (published: Table 2's values
            on this design). "k6", "all four": robots whose k6 factor, or all four, are at least as published. "Y beats
            all": at the poses of section 3."""),
        *table(["simulated", "k6 Y:all", "k1 Y:all", "k3 Y:all", "k3 X:Y", "Y readings", "k6", "all four", "Y beats all"],
               rows),
        *text(f"""
            Other minima of eq. 12: converged fits from Table 2's own values and from five random starts that end over 5 %
            away in some k: {other_minima(design, World())} (data as (a)); {other_minima(design, untrue)} (all effects and
            the rod)."""),
        *text("""
            The published Y and all sets on the same 300 N along Y, over 72 TCP positions and tool lengths (x 1.2-1.8, y
            0-0.4, z 0.5-1.1, 0.1-0.5 m before the flange) and the reachable ones of 500 orientations at each; distance of
            the two predictions, proportional to the force:"""),
        *disagreement(),
        *conclusions(),
    ]


def conclusions() -> list[str]:
    """What the table of section 5 allows to say."""
    return [
        "### What follows", "",
        *text("""
            - **Noise of 1 µm alone cannot give it** on orientations that are spread: k6 and k1 of Y and all then agree
            within two per cent, k3 within 30 % (on this design; within a factor 1.8 on 20 others)."""),
        *text("""
            - **k3 (2.6 and 4.1)** is consistent with any larger disturbance: noise of tens of µm, re-seating, force error,
            backlash, several effects at once. Y tells k3 weakly, and the stated 1 µm overrates what it tells. Rod, base,
            spindle, turned force, side load of these sizes did not give it by themselves. No cause can be named from it."""),
        *text("""
            - **k6 (31.6) and k1 (3.1)** came out of no converged fit on spread orientations, whatever was simulated, alone
            or together. Consistent with them: a solver that ends before the minimum - SLSQP with the cost weighted by 1 µm,
            unscaled, does, and exceeds 31.6 in k6 in about a tenth of the robots, all four factors in one of 60 - and, in a
            few per cent of the robots, Y orientations within 20° of each other together with several unmodelled effects.
            Other minima are no explanation, hardly any were found; the wrong load path by itself cannot give them."""),
        *text("""
            - **The Y set and the all set contradict each other on the data they share.** At 300 N they are 1.1 mm apart on
            this design, and among the sampled poses never closer than 0.2 mm in three orientations of one position; one of
            the two misses the readings by at least half of that. Of the simulated converged fits 95 % are within 0.06 mm,
            with every effect at once. So an unconverged fit, other data behind one of the sets, much smaller forces, or a
            slip in the printed table are consistent with it (the last three not simulated); sensor noise, the rod and the
            other effects, of these sizes, are not by themselves."""),
        *text("- Which of these happened cannot be told without the readings, and the paper does not print them."),
    ]
