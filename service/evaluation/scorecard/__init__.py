"""The scorecard: everything that is asked of a counter and can be measured on recordings, for any counter."""
