"""All built-in covariances, imported in one place so that an artifact can name any of them."""

from glovecal_models.covariance.linear_ard import LinearArd
from glovecal_models.covariance.polynomial import Polynomial
from glovecal_models.covariance.squared_exponential import SquaredExponential
from glovecal_models.covariance.squared_exponential_ard import SquaredExponentialArd

__all__ = ["LinearArd", "Polynomial", "SquaredExponential", "SquaredExponentialArd"]
