//! panorama
