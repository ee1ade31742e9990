//! Geometry and errors of a depth sensor.

/// A pinhole camera without distortion. Pixel (u, v) at depth z sees the point
/// ((u − cx) z / fx, (v − cy) z / fy, z) of the camera's frame: x right, y down, z ahead.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct Intrinsics {
    /// Columns and rows.
    pub size: [usize; 2],
    /// Focal lengths in pixels.
    pub focal: [f32; 2],
    /// Principal point in pixels.
    pub center: [f32; 2],
    /// Metres in a unit of the image.
    pub depth_unit: f32,
}

/// How a sensor errs: by a part that grows with the range, by a part that does not, and by rounding.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct SensorModel {
    /// The part of the standard deviation of depth that grows with the square of the range, as in all
    /// that triangulates: at a range of 1 m, metres.
    pub noise: f32,
    /// The part that is the same at any range, metres.
    pub floor: f32,
    /// Between one depth that the sensor tells and the next, metres. [`DepthCamera::new`](super::DepthCamera::new) takes the
    /// unit of the image where that is larger, and [`DepthCamera::points`](super::DepthCamera::points) what its frame shows.
    pub step: f32,
    /// Nearest and farthest range that is believed, metres.
    pub range: [f32; 2],
}

impl Default for SensorModel {
    /// A Kinect (Khoshelham and Elberink 2012, doi:10.3390/s120201437) whose depths are whole
    /// millimetres. The floor is what is left of 0.45 mm, measured at 0.4 m.
    fn default() -> Self {
        Self {
            noise: 1.42e-3,
            floor: 0.26e-3,
            step: 1e-3,
            range: [0.3, 8.0],
        }
    }
}

impl SensorModel {
    /// A sensor whose error is the same at any range, as where light is timed: its standard deviation, and the
    /// nearest and farthest range that is believed, metres.
    pub fn time_of_flight(deviation: f32, range: [f32; 2]) -> Self {
        Self {
            noise: 0.0,
            floor: deviation,
            step: 0.0,
            range,
        }
    }

    /// Standard deviation of the depth `z`, both in metres.
    ///
    /// ```
    /// use tldi_sources::depth::SensorModel;
    /// let kinect = SensorModel::default();
    /// assert!((kinect.deviation(0.4) - 0.45e-3).abs() < 0.01e-3);
    /// assert!((kinect.deviation(3.0) - 12.8e-3).abs() < 0.1e-3);
    /// ```
    pub fn deviation(&self, z: f32) -> f32 {
        let growing = self.noise * z * z;
        // What is rounded errs evenly over a step.
        let rounding = self.step * self.step / 12.0;
        (growing * growing + self.floor * self.floor + rounding).sqrt()
    }
}
