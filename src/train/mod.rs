//! Training: samples of posed frames -> correspondences -> fields -> losses -> gradients (thesis ch. 4.3).

pub mod losses;
