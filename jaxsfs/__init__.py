"""jaxsfs: 3-D surfaces from one endoscope image, by shape from shading with the light at the camera.

Words, symbols, units (the same in the whole package):

| word | symbol | meaning |
|---|---|---|
| pixel | (u, v) | image point in px: u right, v down; pixel centres are integers; arrays are `[v, u]` |
| ray | d | unit vector through a pixel; camera frame x right, y down, z forward |
| range | r | distance from the projection centre to the surface point |
| depth | z | component along the optical axis; never the range |
| irradiance | E | image irradiance in linear light, E = ρ G(cos θ)/r² |
| albedo | ρ | with ρ unknown the surface is known up to one scale factor, and ρ = 1 |
| reflectance | G | function of cos θ, θ between surface normal and ray |
| f | f | radius of the projection sphere in px: √(u² + v²) = f sin α |
| inverse metric | g^{ij} | of the ray sphere in pixel coordinates, px² |
| w | w | ln r; the solvers' unknown (z for a distant light) |

Lengths are scene units until a known range or a calibrated gain·ρ makes them millimetres. Angles are radians inside,
degrees in files and at the command line (`_deg`).

Every public name is here once and is imported when first used, so that `import jaxsfs` is fast.
"""

import importlib
from typing import TYPE_CHECKING

_HOME = {
    "jaxsfs.camera": (
        "AbstractCamera",
        "AbstractCentralCamera",
        "CameraFile",
        "Equidistant",
        "Equisolid",
        "KannalaBrandt",
        "Orthographic",
        "Perspective",
        "Scaramuzza",
        "Spherical",
        "Stereographic",
        "camera_from_dict",
        "camera_to_dict",
        "perspective_like",
        "rectification_map",
    ),
    "jaxsfs.reflectance": (
        "AbstractReflectance",
        "BlinnPhong",
        "Lambertian",
        "OrenNayar",
        "Phong",
        "Power",
        "parse_reflectance",
    ),
    "jaxsfs.photometry": (
        "AbstractFalloff",
        "AbstractResponse",
        "CosineFalloff",
        "ExponentialFalloff",
        "GammaResponse",
        "LinearResponse",
        "NoFalloff",
        "SRGBResponse",
        "parse_falloff",
        "parse_response",
    ),
    "jaxsfs.irradiance": ("Irradiance",),
    "jaxsfs.lights": ("Light", "Lights", "lights_from_dict", "lights_to_dict", "shade_lights"),
    "jaxsfs.surface": ("Surface",),
    "jaxsfs.implicit": ("log_range",),
    "jaxsfs.initial": ("Curve", "Deadline", "SingularPoint", "SummitHeights", "Threshold"),
    "jaxsfs.reconstruction": ("Reconstruction", "Statistics", "Status", "reconstruct", "residual_map", "scaled_to"),
    "jaxsfs.rendering": ("photograph", "render", "render_distant", "render_lights", "shade", "shade_distant"),
    "jaxsfs.photo": ("PhotoReport", "irradiance_of"),
    "jaxsfs.refinement": ("Refinement", "RefinementStatus", "refine"),
    "jaxsfs.field": ("FieldMask", "find_field"),
    "jaxsfs.evaluation": ("Evaluation", "evaluate"),
    "jaxsfs.measuring": ("Area", "Length", "measure_area", "measure_length"),
    "jaxsfs.mesh": ("mesh_from_surface",),
    "jaxsfs.animation": ("front_frames",),
    "jaxsfs.pictures": ("depth_picture", "shaded_picture"),
    "jaxsfs.convert": ("export_camera", "import_camera"),
    "jaxsfs.files": (
        "InputError",
        "read_camera",
        "read_image",
        "read_lights",
        "read_map",
        "read_mask",
        "read_result",
        "write_camera",
    ),
}
_MODULE_OF = {name: module for module, names in _HOME.items() for name in names}
__all__ = tuple(sorted(_MODULE_OF))  # pyright: ignore[reportUnsupportedDunderAll]
__version__ = "0.1.0"

if TYPE_CHECKING:  # what the table says, for editors and type checkers
    from jaxsfs.animation import (
        front_frames as front_frames,
    )
    from jaxsfs.camera import (
        AbstractCamera as AbstractCamera,
    )
    from jaxsfs.camera import (
        AbstractCentralCamera as AbstractCentralCamera,
    )
    from jaxsfs.camera import (
        CameraFile as CameraFile,
    )
    from jaxsfs.camera import (
        Equidistant as Equidistant,
    )
    from jaxsfs.camera import (
        Equisolid as Equisolid,
    )
    from jaxsfs.camera import (
        KannalaBrandt as KannalaBrandt,
    )
    from jaxsfs.camera import (
        Orthographic as Orthographic,
    )
    from jaxsfs.camera import (
        Perspective as Perspective,
    )
    from jaxsfs.camera import (
        Scaramuzza as Scaramuzza,
    )
    from jaxsfs.camera import (
        Spherical as Spherical,
    )
    from jaxsfs.camera import (
        Stereographic as Stereographic,
    )
    from jaxsfs.camera import (
        camera_from_dict as camera_from_dict,
    )
    from jaxsfs.camera import (
        camera_to_dict as camera_to_dict,
    )
    from jaxsfs.camera import (
        perspective_like as perspective_like,
    )
    from jaxsfs.camera import (
        rectification_map as rectification_map,
    )
    from jaxsfs.convert import (
        export_camera as export_camera,
    )
    from jaxsfs.convert import (
        import_camera as import_camera,
    )
    from jaxsfs.evaluation import (
        Evaluation as Evaluation,
    )
    from jaxsfs.evaluation import (
        evaluate as evaluate,
    )
    from jaxsfs.field import (
        FieldMask as FieldMask,
    )
    from jaxsfs.field import (
        find_field as find_field,
    )
    from jaxsfs.files import (
        InputError as InputError,
    )
    from jaxsfs.files import (
        read_camera as read_camera,
    )
    from jaxsfs.files import (
        read_image as read_image,
    )
    from jaxsfs.files import (
        read_lights as read_lights,
    )
    from jaxsfs.files import (
        read_map as read_map,
    )
    from jaxsfs.files import (
        read_mask as read_mask,
    )
    from jaxsfs.files import (
        read_result as read_result,
    )
    from jaxsfs.files import (
        write_camera as write_camera,
    )
    from jaxsfs.implicit import (
        log_range as log_range,
    )
    from jaxsfs.initial import (
        Curve as Curve,
    )
    from jaxsfs.initial import (
        Deadline as Deadline,
    )
    from jaxsfs.initial import (
        SingularPoint as SingularPoint,
    )
    from jaxsfs.initial import (
        SummitHeights as SummitHeights,
    )
    from jaxsfs.initial import (
        Threshold as Threshold,
    )
    from jaxsfs.irradiance import (
        Irradiance as Irradiance,
    )
    from jaxsfs.lights import (
        Light as Light,
    )
    from jaxsfs.lights import (
        Lights as Lights,
    )
    from jaxsfs.lights import (
        lights_from_dict as lights_from_dict,
    )
    from jaxsfs.lights import (
        lights_to_dict as lights_to_dict,
    )
    from jaxsfs.lights import (
        shade_lights as shade_lights,
    )
    from jaxsfs.measuring import (
        Area as Area,
    )
    from jaxsfs.measuring import (
        Length as Length,
    )
    from jaxsfs.measuring import (
        measure_area as measure_area,
    )
    from jaxsfs.measuring import (
        measure_length as measure_length,
    )
    from jaxsfs.mesh import (
        mesh_from_surface as mesh_from_surface,
    )
    from jaxsfs.photo import (
        PhotoReport as PhotoReport,
    )
    from jaxsfs.photo import (
        irradiance_of as irradiance_of,
    )
    from jaxsfs.photometry import (
        AbstractFalloff as AbstractFalloff,
    )
    from jaxsfs.photometry import (
        AbstractResponse as AbstractResponse,
    )
    from jaxsfs.photometry import (
        CosineFalloff as CosineFalloff,
    )
    from jaxsfs.photometry import (
        ExponentialFalloff as ExponentialFalloff,
    )
    from jaxsfs.photometry import (
        GammaResponse as GammaResponse,
    )
    from jaxsfs.photometry import (
        LinearResponse as LinearResponse,
    )
    from jaxsfs.photometry import (
        NoFalloff as NoFalloff,
    )
    from jaxsfs.photometry import (
        SRGBResponse as SRGBResponse,
    )
    from jaxsfs.photometry import (
        parse_falloff as parse_falloff,
    )
    from jaxsfs.photometry import (
        parse_response as parse_response,
    )
    from jaxsfs.pictures import (
        depth_picture as depth_picture,
    )
    from jaxsfs.pictures import (
        shaded_picture as shaded_picture,
    )
    from jaxsfs.reconstruction import (
        Reconstruction as Reconstruction,
    )
    from jaxsfs.reconstruction import (
        Statistics as Statistics,
    )
    from jaxsfs.reconstruction import (
        Status as Status,
    )
    from jaxsfs.reconstruction import (
        reconstruct as reconstruct,
    )
    from jaxsfs.reconstruction import (
        residual_map as residual_map,
    )
    from jaxsfs.reconstruction import (
        scaled_to as scaled_to,
    )
    from jaxsfs.refinement import (
        Refinement as Refinement,
    )
    from jaxsfs.refinement import (
        RefinementStatus as RefinementStatus,
    )
    from jaxsfs.refinement import (
        refine as refine,
    )
    from jaxsfs.reflectance import (
        AbstractReflectance as AbstractReflectance,
    )
    from jaxsfs.reflectance import (
        BlinnPhong as BlinnPhong,
    )
    from jaxsfs.reflectance import (
        Lambertian as Lambertian,
    )
    from jaxsfs.reflectance import (
        OrenNayar as OrenNayar,
    )
    from jaxsfs.reflectance import (
        Phong as Phong,
    )
    from jaxsfs.reflectance import (
        Power as Power,
    )
    from jaxsfs.reflectance import (
        parse_reflectance as parse_reflectance,
    )
    from jaxsfs.rendering import (
        photograph as photograph,
    )
    from jaxsfs.rendering import (
        render as render,
    )
    from jaxsfs.rendering import (
        render_distant as render_distant,
    )
    from jaxsfs.rendering import (
        render_lights as render_lights,
    )
    from jaxsfs.rendering import (
        shade as shade,
    )
    from jaxsfs.rendering import (
        shade_distant as shade_distant,
    )
    from jaxsfs.surface import (
        Surface as Surface,
    )


def __getattr__(name: str) -> object:
    if name not in _MODULE_OF:
        raise AttributeError(f"module 'jaxsfs' has no attribute {name!r}")
    return getattr(importlib.import_module(_MODULE_OF[name]), name)


def __dir__() -> list[str]:
    return sorted([*globals(), *__all__])
