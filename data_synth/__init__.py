"""Synthetic endoscope views with exact ground truth, rendered on demand."""

from data_synth.catalogue import (
    REPORT_SEEDS as REPORT_SEEDS,
    SCENES as SCENES,
    TUNING_SEEDS as TUNING_SEEDS,
    default_camera as default_camera,
    random_scene as random_scene,
    scene_from_dict as scene_from_dict,
    scene_from_text as scene_from_text,
    scene_to_dict as scene_to_dict,
)
from data_synth.effects import Photo as Photo, take_photo as take_photo
from data_synth.highlights import tissue_colours as tissue_colours, wet_glints as wet_glints
from data_synth.occluding import (
    BallInBowl as BallInBowl,
    FoldedColon as FoldedColon,
    PolypWall as PolypWall,
    Vase as Vase,
)
from data_synth.occlusion import find_cuts as find_cuts
from data_synth.sample import Sample as Sample, render_scene as render_scene
from data_synth.scene import AbstractScene as AbstractScene, Hit as Hit
from data_synth.smooth import Ball as Ball, HollowBall as HollowBall, Plane as Plane, Tube as Tube, WavyWall as WavyWall
from data_synth.vessels import vessel_colours as vessel_colours
from data_synth.viewing import View as View, look as look, observe as observe
