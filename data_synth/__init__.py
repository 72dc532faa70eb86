"""Synthetic endoscope views with exact ground truth, rendered on demand."""

from data_synth.occluding import BallInBowl as BallInBowl
from data_synth.occluding import FoldedColon as FoldedColon
from data_synth.occluding import PolypWall as PolypWall
from data_synth.occluding import Vase as Vase
from data_synth.occlusion import find_cuts as find_cuts
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
