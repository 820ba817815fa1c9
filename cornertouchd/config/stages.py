"""The settings of the mathematics, from pictures to touches, one model for each stage."""

from typing import Literal

from pydantic import Field

from cornertouchd.config.table import Table


class PaperVisionSettings(Table):
    """Thresholds of the edge search of Wang et al. 2011; used when vision.edges is "paper"."""

    t1: float = Field(
        80.0,
        ge=0.1,
        le=510.0,
        description="T1 of the paper: smallest gradient along the strip, in grey levels, that is "
        "an edge. Keep it above that of the LEDs' own ripple; a finger has 150 and more.",
    )
    t2_px: float = Field(
        1.0, ge=0.1, le=100.0, description="T2 of the paper: narrowest shadow that is kept."
    )
    t3_px: float = Field(
        120.0, ge=1.0, le=8192.0, description="T3 of the paper: widest shadow that is kept."
    )


class VisionSettings(Table):
    """How shadows are found in the pictures of one camera."""

    edges: Literal["profile", "paper"] = Field(
        "profile",
        description='How the edges of a shadow are measured: "profile" compares with the empty '
        'strip, "paper" is the method of Wang et al. 2011, for comparison.',
    )
    shadow_below: float = Field(
        0.9,
        ge=0.05,
        le=0.999,
        description="A column darker than this share of the empty strip belongs to a shadow. Lower "
        "it if noise or flicker make false touches; thin or distant pens need it high.",
    )
    smallest_shadow_px: float = Field(
        0.5,
        ge=0.01,
        le=100.0,
        description="Smallest shadow that counts, as missing light in full columns. Raise it if "
        "dust or insects are taken for touches.",
    )
    edge_level: float = Field(
        0.52,
        ge=0.05,
        le=0.95,
        description="Share of the light at which a shadow's edge is measured. Found by "
        "measurement; change it only if all diameters come out too large or too small.",
    )
    edge_blur_px: float = Field(
        0.9,
        ge=0.01,
        le=50.0,
        description="Blur of the lens at an edge, as the standard deviation. Raise it for cameras "
        "that are out of focus.",
    )
    dark_share: float = Field(
        0.04,
        ge=0.0,
        le=0.9,
        description="Share of the light that is left in the middle of a full shadow, from "
        "reflections and stray light.",
    )
    horizon_band: float = Field(
        0.14,
        ge=0.01,
        le=1.0,
        description="Rows that are sampled: this share of the strip's height, above and below the "
        "height of the camera. Wider averages more noise out but sees fingers earlier.",
    )
    smallest_reference: float = Field(
        12.0,
        ge=1.0,
        le=255.0,
        description="Grey levels. Columns where the empty strip is darker than this tell nothing "
        "and are left out, as at a dead LED.",
    )
    paper: PaperVisionSettings = PaperVisionSettings()


class PairingSettings(Table):
    """How the pictures of the cameras are put together to one instant."""

    tolerance_ms: float = Field(
        4.0,
        ge=0.1,
        le=100.0,
        description="Pictures taken within this time belong to the same instant. Keep it below "
        "half the time between two pictures.",
    )
    deadline_ms: float = Field(
        15.0,
        ge=0.1,
        le=1000.0,
        description="Longest wait for a late or missing camera; then the others go on without it. "
        "Raise it if cameras are often late, at the price of delay.",
    )


class PaperCrossingSettings(Table):
    """Thresholds of Wang et al. 2011; used when crossing.method is "paper"."""

    th1_mm: float = Field(
        12.0,
        ge=0.1,
        le=500.0,
        description="Th1 of the paper (eq. 10): farthest that a point may lie from each of its "
        "directing lines; about the size of a finger.",
    )
    th2_mm: float = Field(
        0.1,
        ge=0.001,
        le=100.0,
        description="Th2 of the paper (eq. 11): a point that lies nearer than this to one already "
        "accepted is the same point.",
    )


class CrossingSettings(Table):
    """How the shadows of all cameras become contacts."""

    method: Literal["default", "paper"] = Field(
        "default",
        description='"default" explains the edges of all shadows together and refuses ghosts; '
        '"paper" is the method of Wang et al. 2011, for comparison.',
    )
    smallest_radius_mm: float = Field(
        3.3,
        ge=0.1,
        le=100.0,
        description="Smallest radius of a contact. Lower it for thin pens; more ghosts may pass.",
    )
    largest_radius_mm: float = Field(
        35.0,
        ge=0.5,
        le=1000.0,
        description="Largest radius of a contact. Raise it if palms or large objects are to be "
        "reported.",
    )
    edge_sigma_px: float = Field(
        0.1,
        ge=0.001,
        le=10.0,
        description="Standard deviation of a measured shadow edge. Raise it for noisy cameras.",
    )
    shape_sigma_mm: float = Field(
        0.4,
        ge=0.0,
        le=50.0,
        description="Standard deviation of the outline of what touches from a circle; fingers are "
        "not quite round.",
    )
    paper: PaperCrossingSettings = PaperCrossingSettings()


class TrackingSettings(Table):
    """How contacts are followed from one instant to the next."""

    acceleration_mm_s2: float = Field(
        3000.0,
        ge=1.0,
        le=1_000_000.0,
        description="Ordinary acceleration of a finger. Higher follows quick moves more closely, "
        "lower smooths more.",
    )
    gate_mm: float = Field(
        25.0,
        ge=0.1,
        le=1000.0,
        description="Farthest from where a touch is expected that a contact is still taken for it.",
    )
    confirm_frames: int = Field(
        2,
        ge=1,
        le=100,
        description="Frames in a row in which a doubtful new contact must be seen, by three "
        "cameras, before it is reported. Each costs it one frame of delay and refuses more false "
        "touches. What is clear is reported at once.",
    )
    coast_frames: int = Field(
        2,
        ge=0,
        le=100,
        description="Frames for which a touch that is not seen is carried on before it is lifted.",
    )
