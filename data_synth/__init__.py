"""Synthetic endoscope views with exact ground truth, rendered on demand."""

from data_synth.scene import AbstractScene as AbstractScene
from data_synth.scene import Hit as Hit
from data_synth.smooth import Ball as Ball
from data_synth.smooth import HollowBall as HollowBall
from data_synth.smooth import Plane as Plane
from data_synth.smooth import Tube as Tube
from data_synth.smooth import WavyWall as WavyWall
from data_synth.viewing import View as View
from data_synth.viewing import look as look
from data_synth.viewing import observe as observe
