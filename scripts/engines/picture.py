"""Pictures of engines side by side, one exposure and one curve for all."""

import numpy as np
from PIL import Image, ImageDraw, ImageFont

MARGIN, TITLE = 6, 20


def write(path, pictures, columns=2):
    """`pictures`: radiance (height, width, 3) by name. Exposed so that the median is a middle grey in all of them."""
    exposure = 0.35 / np.median([np.median(p) for p in pictures.values()])
    height, width, _ = next(iter(pictures.values())).shape
    rows = -(-len(pictures) // columns)
    sheet = Image.new("RGB", (columns * (width + MARGIN) - MARGIN, rows * (height + TITLE)), "white")
    draw, font = ImageDraw.Draw(sheet), ImageFont.load_default(size=14)
    for k, (name, radiance) in enumerate(pictures.items()):
        x, y = k % columns * (width + MARGIN), k // columns * (height + TITLE)
        v = np.clip(exposure * radiance, 0, None)
        # all below the knee as it is, what is brighter rolled off
        v = np.where(v < 0.6, v, 1 - 0.4 * np.exp(-(v - 0.6) / 0.4))
        srgb = np.where(v <= 0.0031308, 12.92 * v, 1.055 * v ** (1 / 2.4) - 0.055)
        draw.text((x + 2, y + 1), name, fill="black", font=font)
        sheet.paste(Image.fromarray((255 * srgb + 0.5).astype(np.uint8)), (x, y + TITLE))
    sheet.save(path, optimize=True)
