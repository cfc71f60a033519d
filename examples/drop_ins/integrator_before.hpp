// Sums the angle of rate samples, and publishes it every four of them: the common kind, without a coning correction.
#pragma once

class DeltaAngleIntegrator {
public:
    // Takes a sample of the rate in rad/s and the time in s that it stands for; true where a delta angle is ready.
    bool update(const float rates[3], float dt)
    {
        if (count_ == 4) {
            count_ = 0;
            for (float &angle : delta_angle) angle = 0.0F;
        }
        for (int axis = 0; axis < 3; ++axis) delta_angle[axis] += rates[axis] * dt;
        return ++count_ == 4;
    }

    float delta_angle[3] = {}; // rad, of the last four samples

private:
    int count_ = 0;
};
