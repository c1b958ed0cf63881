"""A result document with invented numbers, for pages that show many sections."""

from __future__ import annotations

import math
from typing import Any


def whole_result() -> dict[str, Any]:
    """Return a result document with a verdict and most sections of an identification report."""
    count = 400
    time_s = [0.02 * i for i in range(count)]
    joints = ("axis1", "axis2", "axis3")

    def wave(i: int, k: int) -> float:
        return 90.0 * math.sin(0.13 * i + k) + 25.0 * math.copysign(1.0, math.sin(0.05 * i + k))

    def drawn(deviation_m: float) -> dict[str, Any]:
        turn = [2.0 * math.pi * i / 100 for i in range(100)]
        return {
            "time_s": [0.02 * i for i in range(100)],
            "wanted_m": [
                [0.5 + 0.2 * math.cos(angle) for angle in turn],
                [0.2 * math.sin(angle) for angle in turn],
                [-1.7 for _ in turn],
            ],
            "deviation_m": [
                [deviation_m * math.cos(k * angle) for angle in turn] for k in (1, 2, 3)
            ],
            "distance_m": [deviation_m for _ in turn],
            "joint": [[deviation_m * math.sin(angle + k) for angle in turn] for k in range(3)],
        }

    def size(deviation_m: float) -> dict[str, Any]:
        peaks = [2.0 * deviation_m] * 3
        bending = {"rms_m": 1.1e-3, "max_m": 1.8e-3, "tool_mean_m": 1e-3, "tool_max_m": 1.6e-3}
        size = {"mean_m": deviation_m, "max_m": 2.0 * deviation_m, "joint_peak": peaks}
        return {**size, "bending": bending}

    frequency_hz = [0.1 * i for i in range(1, 200)]
    return {
        "schema": "rid-daq result 1",
        "title": "Identification of ir361",
        "robot": "ir361",
        "cell": {"name": "ir361", "simulated": True, "cycle_time_ms": 8, "bus": "rid_sim:ir361"},
        "seed": 1,
        "verdict": {
            "passed": True,
            "headline": "Passed: the model predicts the validation run",
            "sentence": "The prediction error of the worst axis is 1.12 times the noise floor.",
            "checks": [
                {
                    "text": "prediction error of the worst axis, divided by the noise floor",
                    "value": 1.12,
                    "relation": "≤",
                    "limit": 1.3,
                    "unit": "",
                    "passed": True,
                }
            ],
        },
        "runs": [
            {
                "role": "excitation",
                "sentence": "Fourier motion, 16 periods of 10 s after 1 transient period.",
                "stop": "Stopped before its end: axis2 is 0.06 rad off its set-point.",
                "stop_curve": {
                    "joint": "axis2",
                    "quantity": "following error",
                    "unit": "rad",
                    "time_s": [-0.008 * i for i in range(125, -1, -1)],
                    "value": [0.06 * math.exp(-0.04 * i) for i in range(125, -1, -1)],
                    "low": [-0.05 - 0.0001 * i for i in range(126)],
                    "high": [0.05 + 0.0001 * i for i in range(126)],
                },
                "rows": 21250,
                "invalid_rows": 0,
                "duration_s": 170.0,
                "axes": [
                    {
                        "joint": joint,
                        "unit": "rad",
                        "torque_unit": "N m",
                        "position_min": -1.2,
                        "position_max": 1.1,
                        "max_velocity": 2.1,
                        "max_torque": 201.0,
                        "max_torque_percent": 44.7,
                        "max_following_error": 0.0123,
                    }
                    for joint in joints
                ],
                "bad_rows": [{"rows": "2-20", "count": 19, "reason": "a value is absurd: 1e250"}],
            }
        ],
        "average": {
            "sentence": "15 of 16 periods averaged, 1250 samples each.",
            "periods_kept": 15,
            "samples_per_period": 1250,
            "missing_samples": 0,
            "rejected": [{"index": 3, "reason": "7 samples are missing"}],
            "axes": [
                {
                    "joint": joint,
                    "torque_noise": 1.3,
                    "torque_unit": "N m",
                    "position_noise": 1.1e-5,
                    "unit": "rad",
                }
                for joint in joints
            ],
        },
        "estimate": {
            "sentence": "Maximum likelihood on 250 bins; condition number 31.",
            "method": "periodic",
            "condition_number": 31.0,
            "equations": 750,
            "band_hz": 10.0,
            "periods": 15,
            "weighting": "ml",
            "unseen": ["m1"],
            "has_truth": True,
            "parameters": [
                {
                    "name": f"Izz{i}",
                    "words": f"Izz{i} + 0.2304 m3 {'+ 151 Im2' if i > 3 else ''}",
                    "unit": "kg m²",
                    "value": 12.3456 / i**3,
                    "std": 0.0123,
                    "std_noise": 0.0021,
                    "std_residual": 0.0123,
                    "truth": 12.34 / i**3,
                    "deviation_sigmas": 0.0056 / i**3 / 0.0123,
                    "inside_two_sigma": i % 4 != 0,
                }
                for i in range(1, 24)
            ],
            "axes": [
                {
                    "joint": joint,
                    "unit": "N m",
                    "residual": 2.1,
                    "noise": 1.3,
                    "left_out_fraction": 0.04,
                }
                for joint in joints
            ],
        },
        "truth": [
            {
                "title": title,
                "sentence": f"{title}: 21 of 23 true values are inside their intervals.",
                "inside": 21,
                "of": 23,
                "deviation_sigmas": [reach * math.sin(2.3 * i) for i in range(23)],
            }
            for title, reach in (("unmodelled effects on", 12.0), ("unmodelled effects off", 1.9))
        ],
        "validation": {
            "sentence": "20 random poses; samples with |velocity| above 0.02 rad/s are compared.",
            "cutoff_hz": 10.0,
            "standstill_rad_s": 0.02,
            "has_floor": True,
            "has_limits": True,
            "axes": [
                {
                    "joint": joint,
                    "unit": "N m",
                    "rms_torque": 71.0,
                    "rms_error": 4.31,
                    "relative_error_percent": 6.07,
                    "all_samples_percent": 6.5,
                    "noise": 1.29,
                    "floor": 3.9,
                    "error_over_floor": 1.105,
                    "limit_percent": 10.0,
                    "passed": True,
                    "samples": 3712,
                }
                for joint in joints
            ],
        },
        "tracking": {
            "sentence": "Distance between the planned and the reached tool point.",
            "joints": [{"joint": joint, "unit": "rad"} for joint in joints],
            "unseen": "The deflection of the gears is not included.",
            "with_stiffness": [*joints[:1]],
            "without_stiffness": [*joints[1:]],
            "tool_side": [],
            "motions": [
                {
                    "sentence": f"Motion of {use}.",
                    "use": use,
                    "after": size(2e-5),
                    "before": size(2e-3) if before else None,
                    "mean_ratio": 100.0 if before else None,
                    "max_ratio": 100.0 if before else None,
                    "drawn": {"after": drawn(2e-5), "before": drawn(2e-3) if before else None},
                }
                for use, before in (("tuned on it", True), ("never used", False))
            ],
        },
        "curves": {
            "torque": {
                "sentence": "Grey: standstill; its errors are not counted.",
                "time_s": time_s,
                "axes": [
                    {
                        "joint": joint,
                        "unit": "N m",
                        "caption": "rms error 4.31 N m, 6.07 % of the torque",
                        "counted": [int(i % 50 > 5) for i in range(count)],
                        "measured": [
                            wave(i, k) + 3.0 * math.sin(7.7 * i * i) for i in range(count)
                        ],
                        "predicted": [wave(i, k) for i in range(count)],
                    }
                    for k, joint in enumerate(joints)
                ],
            },
            "spectrum": {
                "sentence": "Amplitude of the residual at each harmonic.",
                "frequency_hz": frequency_hz,
                "axes": [
                    {
                        "joint": joint,
                        "unit": "N m",
                        "measured_nm": [20.0 / (1.0 + f) + 0.03 for f in frequency_hz],
                        "residual_nm": [2.0 / (1.0 + f) + 0.03 for f in frequency_hz],
                        "noise_nm": [0.04 for _ in frequency_hz],
                    }
                    for joint in joints
                ],
            },
        },
        "timing": {
            "created_utc": "2026-01-01T12:00:00Z",
            "elapsed_s": 47.11,
            "loops": [
                {
                    "role": "excitation",
                    "sentence": "21 250 cycles, 0 overruns, 0 missed answers.",
                    "edges_us": [0.0, 10.0, 20.0, 50.0, 100.0, 200.0, 500.0, 1000.0],
                    "counts": [9000, 8000, 3000, 900, 200, 80, 40, 0],
                    "cycles": 21250,
                    "overruns": 0,
                    "missed_frames": [0, 0, 0],
                    "lateness_p50_s": 1e-5,
                    "lateness_p99_s": 1e-4,
                    "lateness_max_s": 5e-4,
                    "lateness_edges_s": [0.0, 1e-5, 2e-5, 5e-5, 1e-4, 2e-4, 5e-4, 1e-3],
                    "lateness_counts": [9000, 8000, 3000, 900, 200, 80, 40, 0],
                    "exchange_p50_s": 4e-4,
                    "exchange_p99_s": 5e-4,
                    "exchange_max_s": 6e-4,
                }
            ],
        },
        "software": {"rid-daq": "0.1.0", "python": "3.11.2"},
    }
