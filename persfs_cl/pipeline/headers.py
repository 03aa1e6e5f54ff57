def pixels_of(job):
    from PIL import Image

    try:
        with Image.open(job.path) as i:
            return i.size[0] * i.size[1]
    except Exception:
        return 0
