"""Choose torque channel and friction terms of simulated arms whose truth is known.

`python -m benchmarks.honest_choice` judges 84 recordings of arms of three, six and seven axes;
`--quick` judges a few of the three-axis arm. `--tuning` uses the seeds that thresholds were set with,
which the judging ones never contain. Pinocchio simulates the arms (`benchmarks.known_arms`).
"""

from __future__ import annotations

import argparse
import json
import sys
import time
from collections.abc import Iterator
from dataclasses import dataclass, replace
from typing import Final, Literal

import numpy as np
from scipy.interpolate import CubicSpline, make_interp_spline
from scipy.signal import bilinear, filtfilt, lfilter

from acquisition.journal.phases import Phase
from acquisition.processing.smoothing import SmoothedSignals, smooth_nonperiodic
from acquisition.recording.recording import Recording
from benchmarks.known_arms import ARMS, STEP_S, Driven, Friction, MotionKind, drive
from config.arrays import FloatArray
from identification.estimation.estimators import estimate_smoothed
from identification.estimation.options import EstimationOptions
from identification.validation.model_choice import ModelChoice, choose_model
from identification.validation.robot_terms import with_friction
from identification.validation.torque_prediction import validate
