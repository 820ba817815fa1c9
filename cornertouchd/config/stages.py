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
        description="Grey levels. Columns where the empty strip is darker than this, or than a "
        "quarter of the rest of the strip, tell nothing and are left out, as at a dead LED.",
    )
    saturated_grey: float = Field(
        250.0,
        ge=100.0,
        le=256.0,
        description="Grey level from which on a pixel is at full scale. A column that reaches it, "
        "in the sun for example, tells nothing until the background has followed. 256 believes "
        "every pixel.",
    )
    paper: PaperVisionSettings = PaperVisionSettings()


class BackgroundSettings(Table):
    """How the look of the empty strip is followed while the daemon runs."""

    learn: bool = Field(
        True,
        description="Follow slow changes of the LEDs and of the daylight. Otherwise all pictures "
        "are measured against those of the calibration.",
    )
    time_constant_s: float = Field(
        30.0,
        ge=1.0,
        le=86_400.0,
        description="How slowly columns without a shadow are followed: 63 % of a change after this "
        "time. At 30 s a sunrise of ten minutes stays within 4 % of the strip's light, and a "
        "sleeve that passes leaves no trace.",
    )
    margin_px: int = Field(
        8,
        ge=0,
        le=1000,
        description="Columns on either side of a shadow that are not followed either: blur, and "
        "light that a finger throws beside its shadow.",
    )
    ambient_smoothing_s: float = Field(
        0.2,
        ge=0.001,
        le=60.0,
        description="Time over which the light of the surroundings is averaged where it changes by "
        "no more than noise, when the LED frame sends dark pictures. What changes by more, as the "
        "sun on moving fingers, counts at once.",
    )
    ambient_age_s: float = Field(
        3.0,
        ge=0.01,
        le=3600.0,
        description="How long a dark picture counts. Afterwards nothing is known of the light of "
        "the surroundings.",
    )


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


class MotionSettings(Table):
    """How pictures that were not taken at the same time are brought together."""

    carry_edges: bool = Field(
        True,
        description="Move each shadow edge by its own velocity to the time that all cameras stand "
        "for. It does nothing while a common trigger takes the pictures together.",
    )


class DirtSettings(Table):
    """How dirt that hangs before the strip is told from touches."""

    after_s: float = Field(
        60.0,
        ge=1.0,
        le=1_000_000.0,
        description="A shadow that stands still for so long, and that no touch explains, is taken "
        "for dirt: the status tells it, and touches go on without it.",
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
        1.5,
        ge=0.1,
        le=100.0,
        description="Smallest radius of a contact. Lower it for thin pens; more ghosts may pass.",
    )
    largest_radius_mm: float = Field(
        35.0,
        ge=0.5,
        le=1000.0,
        description="Largest radius of a disc in the crossing. Palms are put together from "
        "several; tracking.report_palms reports them.",
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
    palm_diameter_mm: float = Field(
        22.0,
        ge=17.0,
        le=1000.0,
        description="What is wider than this in every direction, and not clearly a finger, is a "
        "palm. A thumb laid flat is 20 mm wide.",
    )
    palm_reach_mm: float = Field(
        8.0,
        ge=0.0,
        le=1000.0,
        description="Contacts as near as this to the outline of a palm belong to it.",
    )
    pen_diameter_mm: float = Field(
        6.0,
        ge=0.0,
        le=100.0,
        description="A contact thinner than this is a pen. Fingertips are 7 mm wide and more.",
    )
    paper: PaperCrossingSettings = PaperCrossingSettings()


class TouchPointSettings(Table):
    """Where fingers touch, and whether they do, from the rows above and below the surface line."""

    enabled: bool = Field(
        True,
        description="Report where the tip of a finger is. Off: its section at the height of the "
        "cameras, which a leaning finger has 1 to 2 mm beside its tip; then what hovers counts as "
        "a touch as well.",
    )
    touch_height_mm: float = Field(
        0.0,
        ge=0.0,
        le=0.4,
        description="How high above the surface a finger counts as touching, roughly: told by the "
        "light below it, which soon is all there is. Pens count as touching when they do.",
    )


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
    report_palms: bool = Field(
        False,
        description="Report palms, arms and large objects as touches too. Otherwise what has been "
        "a palm is none, even when it shrinks.",
    )
    smoothing: bool = Field(
        True,
        description="Smooth what is reported: the 1€ filter of Casiez, Roussel and Vogel (2012). "
        "The first report of a touch is never smoothed.",
    )
    min_cutoff_hz: float = Field(
        1.0,
        ge=0.01,
        le=1000.0,
        description="Cutoff of the filter for a finger that is still. Lower it against jitter, "
        "raise it against lag of slow moves.",
    )
    beta: float = Field(
        1.5,
        ge=0.0,
        le=1000.0,
        description="By how many Hz the cutoff rises with each mm/s. A moving finger lags by at "
        "most 0.16 mm divided by this.",
    )
    derivative_cutoff_hz: float = Field(
        2.0,
        ge=0.01,
        le=1000.0,
        description="Cutoff of the filter for the speed that moves the other cutoff.",
    )
    dead_band_mm: float = Field(
        0.08,
        ge=0.0,
        le=10.0,
        description="A finger that is still has to move so far before its report does; then it is "
        "followed until it is still again. 0: reports never rest.",
    )
    predict_ms: float = Field(
        0.0,
        ge=0.0,
        le=100.0,
        description="Report where a moving finger will be after this time, to make up for the "
        "delay of a display. Quick turns and stops overshoot.",
    )
