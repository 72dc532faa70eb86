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

from typing import TYPE_CHECKING

from jaxsfs._lazy import importer

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
    "jaxsfs.arrival": ("ArrivalTimes", "arrival_from_point", "arrival_times"),
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
        "CosineExponentialFalloff",
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
    "jaxsfs.occlusion": ("find_occlusions",),
    "jaxsfs.reconstruction": ("Reconstruction", "reconstruct", "residual_map", "scaled_to"),
    "jaxsfs.status": ("Statistics", "Status"),
    "jaxsfs.rendering": ("photograph", "render", "render_distant", "render_lights", "shade", "shade_distant"),
    "jaxsfs.photo": ("PhotoReport", "irradiance_of"),
    "jaxsfs.refinement": ("Refinement", "RefinementStatus", "refine"),
    "jaxsfs.field": ("FieldMask", "find_field"),
    "jaxsfs.uncertainty": ("calibration_sigma", "irradiance_sigma", "lens_covariance", "moved_lens", "noise_sigma"),
    "jaxsfs.comparison": ("by_angle", "by_length", "cumulative", "mesh_distances"),
    "jaxsfs.evaluation": ("Comparison", "Evaluation", "compare", "evaluate"),
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
    from jaxsfs.arrival import (
        ArrivalTimes as ArrivalTimes,
        arrival_from_point as arrival_from_point,
        arrival_times as arrival_times,
    )
    from jaxsfs.camera import (
        AbstractCamera as AbstractCamera,
        AbstractCentralCamera as AbstractCentralCamera,
        CameraFile as CameraFile,
        Equidistant as Equidistant,
        Equisolid as Equisolid,
        KannalaBrandt as KannalaBrandt,
        Orthographic as Orthographic,
        Perspective as Perspective,
        Scaramuzza as Scaramuzza,
        Spherical as Spherical,
        Stereographic as Stereographic,
        camera_from_dict as camera_from_dict,
        camera_to_dict as camera_to_dict,
        perspective_like as perspective_like,
        rectification_map as rectification_map,
    )
    from jaxsfs.comparison import (
        by_angle as by_angle,
        by_length as by_length,
        cumulative as cumulative,
        mesh_distances as mesh_distances,
    )
    from jaxsfs.convert import (
        export_camera as export_camera,
        import_camera as import_camera,
    )
    from jaxsfs.evaluation import (
        Comparison as Comparison,
        Evaluation as Evaluation,
        compare as compare,
        evaluate as evaluate,
    )
    from jaxsfs.field import (
        FieldMask as FieldMask,
        find_field as find_field,
    )
    from jaxsfs.files import (
        InputError as InputError,
        read_camera as read_camera,
        read_image as read_image,
        read_lights as read_lights,
        read_map as read_map,
        read_mask as read_mask,
        read_result as read_result,
        write_camera as write_camera,
    )
    from jaxsfs.implicit import (
        log_range as log_range,
    )
    from jaxsfs.initial import (
        Curve as Curve,
        Deadline as Deadline,
        SingularPoint as SingularPoint,
        SummitHeights as SummitHeights,
        Threshold as Threshold,
    )
    from jaxsfs.irradiance import (
        Irradiance as Irradiance,
    )
    from jaxsfs.lights import (
        Light as Light,
        Lights as Lights,
        lights_from_dict as lights_from_dict,
        lights_to_dict as lights_to_dict,
        shade_lights as shade_lights,
    )
    from jaxsfs.measuring import (
        Area as Area,
        Length as Length,
        measure_area as measure_area,
        measure_length as measure_length,
    )
    from jaxsfs.mesh import (
        mesh_from_surface as mesh_from_surface,
    )
    from jaxsfs.occlusion import find_occlusions as find_occlusions
    from jaxsfs.photo import (
        PhotoReport as PhotoReport,
        irradiance_of as irradiance_of,
    )
    from jaxsfs.photometry import (
        AbstractFalloff as AbstractFalloff,
        AbstractResponse as AbstractResponse,
        CosineExponentialFalloff as CosineExponentialFalloff,
        CosineFalloff as CosineFalloff,
        ExponentialFalloff as ExponentialFalloff,
        GammaResponse as GammaResponse,
        LinearResponse as LinearResponse,
        NoFalloff as NoFalloff,
        SRGBResponse as SRGBResponse,
        parse_falloff as parse_falloff,
        parse_response as parse_response,
    )
    from jaxsfs.pictures import (
        depth_picture as depth_picture,
        shaded_picture as shaded_picture,
    )
    from jaxsfs.reconstruction import (
        Reconstruction as Reconstruction,
        reconstruct as reconstruct,
        residual_map as residual_map,
        scaled_to as scaled_to,
    )
    from jaxsfs.refinement import (
        Refinement as Refinement,
        RefinementStatus as RefinementStatus,
        refine as refine,
    )
    from jaxsfs.reflectance import (
        AbstractReflectance as AbstractReflectance,
        BlinnPhong as BlinnPhong,
        Lambertian as Lambertian,
        OrenNayar as OrenNayar,
        Phong as Phong,
        Power as Power,
        parse_reflectance as parse_reflectance,
    )
    from jaxsfs.rendering import (
        photograph as photograph,
        render as render,
        render_distant as render_distant,
        render_lights as render_lights,
        shade as shade,
        shade_distant as shade_distant,
    )
    from jaxsfs.status import (
        Statistics as Statistics,
        Status as Status,
    )
    from jaxsfs.surface import (
        Surface as Surface,
    )
    from jaxsfs.uncertainty import (
        calibration_sigma as calibration_sigma,
        irradiance_sigma as irradiance_sigma,
        lens_covariance as lens_covariance,
        moved_lens as moved_lens,
        noise_sigma as noise_sigma,
    )


__getattr__ = importer(__name__, _MODULE_OF)


def __dir__() -> list[str]:
    return sorted([*globals(), *__all__])
