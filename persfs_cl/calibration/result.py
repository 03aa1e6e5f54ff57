"""What a calibration comes to."""

from __future__ import annotations

from collections.abc import Mapping
from dataclasses import dataclass

from persfs_cl.preparation.prepare import Preparation
from persfs_cl.shading.model import Light
from persfs_cl.shading.reflectance import Reflectance


@dataclass(frozen=True)
class CalibrationErrors:
    """How far photographs are from being explained, means over all that is known, as shares.

    Attributes
    ----------
    depth : float or None
        Mean of |z - z'| / z' of the depth that is reconstructed; None under a light that does not determine it.
    brightness : float or None
        Mean of |I - I'| / I' of the true surface's brightness; None where single points are known alone.

    Examples
    --------
    >>> from persfs_cl import CalibrationErrors
    >>> CalibrationErrors(depth=0.02)
    CalibrationErrors(depth=0.02, brightness=None)
    """

    depth: float | None = None
    brightness: float | None = None


@dataclass(frozen=True, eq=False)
class Calibration:
    """Light, material, tone and lens, as photographs of known surfaces tell them.

    Attributes
    ----------
    light : Light
    reflectance : Reflectance
        Both as :func:`persfs_cl.reconstruct` takes them.
    preparation : Preparation
        As :func:`persfs_cl.prepare_photo` takes it, with the tone exponent and the vignetting.
    white_level : float or None
        Linear light that is E = 1, under a parallel light: `white` of :meth:`PreparedPhoto.normalised`. None where it
        was not fitted: then each photograph has its own.
    values : mapping of str to float
        What was fitted, by name: gain, white, p0, q0, exponent, lamp_x, lamp_y, lamp_z, vignetting, roughness,
        specular, shininess.
    uncertainties : mapping of str to float
        Standard error of each, in the same unit.
    reasons : mapping of str to str
        What the photographs do not tell, by name, and why not: it has kept the value from where the fit began.
    before, after : CalibrationErrors
        With the values from where the fit began, and with fitted ones. Those after are cross-validated: each part was
        explained by values that were fitted to the others.
    validation : str
        Which parts: "3 photographs" or "5 folds".
    converged : bool
        Whether the numbers had settled when the fit ended. Else do not rely on them.

    Examples
    --------
    A gain that makes depths metres, from one dense truth, and the photograph that it is for:

    >>> import persfs_cl as ps
    >>> scene = ps.hillside((60, 60), light=ps.FlashLight(gain=0.5), surface="toward")
    >>> calibration = ps.calibrate([(scene.image, scene.depth)], scene.camera, light=ps.FlashLight(), fit="gain")
    >>> round(calibration.light.gain, 2)
    0.5
    >>> solution = ps.reconstruct(scene.image, scene.camera, light=calibration.light)
    >>> ps.compare(solution.depth, scene.depth).mean < 0.002
    True
    """

    light: Light
    reflectance: Reflectance
    preparation: Preparation
    white_level: float | None
    values: Mapping[str, float]
    uncertainties: Mapping[str, float]
    reasons: Mapping[str, str]
    before: CalibrationErrors
    after: CalibrationErrors
    validation: str
    converged: bool = True

    def __repr__(self) -> str:
        said = [f"{name}={value:.4g}±{self.uncertainties[name]:.1g}" for name, value in self.values.items()]
        said += [] if self.converged else ["not converged"]
        said += [f"not told: {', '.join(self.reasons)}"] if self.reasons else []
        for what in ("depth", "brightness"):
            before, after = getattr(self.before, what), getattr(self.after, what)
            if before is not None and after is not None:
                said.append(f"{what} error {before:.2g} to {after:.2g}")
        return f"<Calibration {', '.join(said)}>"

    @property
    def exponent(self) -> float:
        """The power that linear light is raised to."""
        return self.preparation.tone_exponent
