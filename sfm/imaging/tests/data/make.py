"""Makes the pictures of this folder (Pillow 12): 37 x 29 pixels, red 6x, green 8y, blue 128, in the variants that the decoder has to read."""
from PIL import Image, ImageOps
from PIL.TiffImagePlugin import IFDRational

W, H = 37, 29
rgb = Image.new("RGB", (W, H))
rgb.putdata([(6 * x, 8 * y, 128) for y in range(H) for x in range(W)])
grey = Image.new("L", (W, H))
grey.putdata([3 * x + 4 * y for y in range(H) for x in range(W)])

for name, subsampling in [("444", 0), ("422", 1), ("420", 2)]:
    rgb.save(f"rgb-{name}.jpg", quality=95, subsampling=subsampling)
rgb.save("progressive-420.jpg", quality=95, subsampling=2, progressive=True)
rgb.save("restarts-420.jpg", quality=95, subsampling=2, restart_marker_blocks=2)
rgb.save("no-transform.jpg", quality=95, subsampling=0, keep_rgb=True)
grey.save("grey.jpg", quality=95)
rgb.convert("CMYK").save("cmyk.jpg", quality=95)
rgb.save("lossy.webp", quality=95)
rgb.save("lossless.webp", lossless=True)

exif = Image.Exif()
exif[0x0112] = 6  # orientation
exif[0x010F] = "Maker "
exif[0x0110] = "Model X"
ifd = exif.get_ifd(0x8769)
ifd[0x920A] = IFDRational(24, 10)  # focal length, mm
ifd[0xA405] = 15  # 35 mm equivalent
ifd[0x9003] = "2026:11:05 12:34:56"
ifd[0x9291] = "250"
ifd[0xA431] = "SN-0042"
ifd[0xA20E] = IFDRational(37 * 1000, 5760)  # focal plane: 37 px on 5.76 mm
ifd[0xA210] = 4  # a millimetre
ifd[0xA002] = W
ifd[0xA003] = H
rgb.save("exif.jpg", quality=95, subsampling=0, exif=exif)
rgb.save("exif.png", exif=exif)
rgb.save("exif.webp", lossless=True, exif=exif)
tiff = Image.Exif()
tiff[0x0112] = 6
rgb.save("exif.tif", exif=tiff, compression="tiff_lzw")
