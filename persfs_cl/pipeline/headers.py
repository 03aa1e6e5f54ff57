"""What would be done with a photograph, as far as headers of files tell, without decoding any pixels."""

from __future__ import annotations

from dataclasses import dataclass

from persfs_cl.camera import Camera
from persfs_cl.errors import CameraError, InputError
from persfs_cl.io.decode import read_header, require_sensor, require_type
from persfs_cl.io.maps import MapKind, check_map
from persfs_cl.io.raster import Header
from persfs_cl.io.video import read_video_header
from persfs_cl.pipeline.frames import frames_for
from persfs_cl.pipeline.job import Job
from persfs_cl.pipeline.optics import horizontal_view

_MAPS: dict[str, MapKind] = {
    "mask": "mask",
    "walls": "mask",
    "known_depth": "depth",
    "albedo": "light",
    "near": "depth",
    "far": "depth",
}


@dataclass(frozen=True)
class Looked:
    """A photograph that can be read, as far as its header tells.

    Attributes
    ----------
    size : (int, int)
        (height, width) of the upright photo.
    bits : int
        Of a sample.
    camera : Camera
    camera_source : str
        What told the focal length.
    horizontal_view : float
        Degrees from the left edge to the right one.
    masked : bool
        Whether a mask goes with it, which fits.
    """

    size: tuple[int, int]
    bits: int
    camera: Camera
    camera_source: str
    horizontal_view: float
    masked: bool

    @property
    def megapixels(self) -> float:
        """Millions of pixels."""
        return self.size[0] * self.size[1] / 1e6


def pixels(job: Job) -> int:
    """How many pixels the photograph of a job has.

    Raises
    ------
    PersfsError
        When its header cannot be read.
    """
    shape = _header(job).shape if job.frame is None else read_video_header(job.path).size
    return shape[0] * shape[1]


def _header(job: Job) -> Header:
    if job.brightness.half_size:
        require_sensor(job.path)
    return read_header(job.path, page=job.brightness.page, half_size=job.brightness.half_size)


def look(job: Job) -> Looked:
    """Look at the files of a job, in a fraction of a millisecond each.

    What is wrong behind a header is not found: a file that breaks off among its pixels, pixels that are NaN, or a mask
    that leaves nothing.

    Raises
    ------
    PersfsError
        As :func:`persfs_cl.pipeline.job.read_job`, for what headers tell: a file that is missing, empty, no image or of
        another size than its photo, or a camera that cannot be or is unknown.

    Warns
    -----
    UserWarning
        As `read_job`.
    """
    orientation = 1
    if job.frame is None:
        header = _header(job)
        require_type(job.path, header.dtype, header.bits)
        size, bits, orientation = (header.shape[0], header.shape[1]), header.bits, header.orientation
    else:
        video = read_video_header(job.path)
        size, bits = video.size, 8
        if job.frame >= video.frames:
            raise InputError(f"{job.path} has no frame {job.frame}, of {video.frames}: choose another.")
    maps = [(kind, getattr(job, name)) for name, kind in _MAPS.items()]
    for kind, file in (*maps, ("light", job.brightness.ambient), ("light", job.brightness.vignetting)):
        if file is not None and not isinstance(file, (str, float, int)):
            check_map(kind, file, size, orientation=orientation, half_size=job.brightness.half_size)
    if job.guide is not None:
        job.guide.check()
    camera, source = job.camera.of(job.path, size)
    straight, shape = camera, size
    try:
        for frame in frames_for(camera, size, job.size):
            straight, shape = frame.camera, frame.shape
        straight.grid(shape)
    except CameraError as error:
        raise error.at(job.title) from error
    return Looked(size, bits, camera, source, horizontal_view(straight, shape), job.mask is not None)
