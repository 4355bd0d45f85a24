"""What the API says of walking: whether somebody does, how sure that is, and what was refused as none."""

from __future__ import annotations

from pydantic import BaseModel, Field

from service.samples import Verdict

CADENCE = "Steps a minute, as the primary says it where it recognises walking; null while nobody walks"
GAIT = "What the primary makes of the motion; null where it does not recognise walking, cannot count or has no data"
REFUSED = (
    "Steps that counters beside the primary counted and the primary refused, since it is the primary, by counter and by"
    " what it made of the motion; none where it does not recognise walking. Told once all steps near are certain, some"
    " seconds later"
)


class GaitModel(BaseModel):
    """Whether somebody walks, as of a moment a little before the newest sample."""

    verdict: Verdict = Field(
        description="`rest`: hardly any motion; `other`: motion that is no walking; `perhaps`: not certain yet, steps"
        " wait to be credited or refused; `walking`"
    )
    confidence: float = Field(description="Probability of walking", ge=0, le=1, examples=[0.97])
    device_s: float = Field(description="Device time of that moment", examples=[21.34])


class RefusedModel(BaseModel):
    """Another counter's steps that the primary refused."""

    rest: int = Field(description="Counted while hardly anything moved")
    other: int = Field(description="Counted in motion that is no walking", examples=[38])
    perhaps: int = Field(description="Counted in what might have been a walk and was too short or too unsure")
