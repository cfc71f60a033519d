// The same interface around generated code: the delta angle is the rotation vector, corrected for coning.
#pragma once
#include "rotation_vector_coning_compressed_4_float.h"

class DeltaAngleIntegrator {
public:
    // Takes a sample of the rate in rad/s and the time in s that it stands for; true where a delta angle is ready.
    bool update(const float rates[3], float dt)
    {
        for (int axis = 0; axis < 3; ++axis) increments_[3 * count_ + axis] = rates[axis] * dt;
        if (++count_ < 4) return false;
        count_ = 0;
        rotation_vector_coning_compressed_4_float(increments_, delta_angle);
        return true;
    }

    float delta_angle[3] = {}; // rad, of the last four samples

private:
    float increments_[12] = {};
    int count_ = 0;
};
