// A table turns by 90 deg/s for a second: what heading does the generated Rust return?
#[path = "../../out/languages/euler_normalize.rs"]
mod euler_normalize;
#[path = "../../out/languages/euler_rk4_2.rs"]
mod euler_rk4_2;

use euler_normalize::euler_normalize;
use euler_rk4_2::{euler_rk4_2, EULER_RK4_2_IDENTITY};

fn main() {
    let increment = 90f64.to_radians() * 0.01; // rad in a sample of 0.01 s
    let mut state = EULER_RK4_2_IDENTITY;
    for _ in 0..50 {
        // two increments a step, x, y, z of the first and then of the second
        state = euler_rk4_2(&state, &[0.0, 0.0, increment, 0.0, 0.0, increment]);
    }
    state = euler_normalize(&state);
    println!("heading {:.9} deg", 2.0 * state[2].atan2(state[3]).to_degrees());
}
