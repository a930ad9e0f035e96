"""A tiny flight with rendered photographs."""

PLAN = {
    "name": "tiny",
    "camera": {"cam": {"preset": "ultracam_d", "size_px": [575, 375], "pixel_um": 180.0}},
    "flight": {"gsd_m": 1.0, "strips": 1, "images_per_strip": 3, "end_lap": 0.6, "heading_deg": 30.0},
    "terrain": {"kind": "undulating", "height_m": 100.0, "relief_rms_m": 10.0, "wavelength_m": 400.0},
    "tie_points": {"per_image": 60, "probability": 0.9, "sigma_um": 9.0},
    "control": {"distance_bases": 1.0, "sigma_m": [0.05, 0.05, 0.05]},
}
