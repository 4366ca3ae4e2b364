//! The product of training.
