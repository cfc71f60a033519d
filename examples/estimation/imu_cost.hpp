// A cost function of Ceres around the header that `strapgen preintegrate --name imu` writes.
#pragma once
#include "imu.hpp"
#include <Eigen/Dense>
#include <ceres/ceres.h>
#include <ceres/rotation.h>

template <class T> using Vector3 = Eigen::Matrix<T, 3, 1>;
const double gravity[3] = { 0.0, 0.0, -9.81 };

template <class T> Vector3<T> vector_of(const Eigen::Quaternion<T> &q)
{
    const T numbers[4] = { q.w(), q.x(), q.y(), q.z() };
    Vector3<T> turn;
    ceres::QuaternionToAngleAxis(numbers, turn.data());
    return turn;
}

// What the samples say less what the states say: rotation, velocity and position in units of their sigmas. A pose is a
// quaternion (x, y, z, w) and a position, a bias that of the rate and that of the specific force.
struct ImuCost {
    Eigen::Quaterniond rotation;
    Eigen::Vector3d velocity, position;
    double duration;
    Eigen::Matrix<double, 9, 6> jacobian;
    Eigen::Matrix<double, 6, 1> bias;
    Eigen::Matrix<double, 9, 9> whitening;

    explicit ImuCost(const strapgen::imu_factor &factor)
        : velocity(factor.velocity), position(factor.position), duration(factor.duration)
    {
        Eigen::Matrix3d r;
        Eigen::Matrix<double, 9, 9> covariance;
        factor.rotation_to(r);
        factor.covariance_to(covariance);
        factor.jacobian_to(jacobian);
        rotation = Eigen::Quaterniond(r);
        bias << Eigen::Vector3d(factor.rate_bias), Eigen::Vector3d(factor.force_bias);
        whitening = covariance.llt().matrixL().solve(Eigen::Matrix<double, 9, 9>::Identity());
    }

    template <class T>
    bool operator()(const T *pose_i, const T *v_i, const T *pose_j, const T *v_j, const T *biases, T *residual) const
    {
        using Map = Eigen::Map<const Vector3<T>>;
        const Eigen::Quaternion<T> back = Eigen::Map<const Eigen::Quaternion<T>>(pose_i).conjugate();
        const Eigen::Quaternion<T> apart = back * Eigen::Map<const Eigen::Quaternion<T>>(pose_j);
        const Eigen::Matrix<T, 6, 1> changed = Eigen::Map<const Eigen::Matrix<T, 6, 1>>(biases) - bias.cast<T>();
        const Eigen::Matrix<T, 9, 1> moved = jacobian.cast<T>() * changed;
        T turn[4];
        ceres::AngleAxisToQuaternion(moved.data(), turn);
        const Eigen::Quaternion<T> said = rotation.cast<T>() * Eigen::Quaternion<T>(turn[0], turn[1], turn[2], turn[3]);
        const Vector3<T> g = Eigen::Map<const Eigen::Vector3d>(gravity).cast<T>();
        const T t(duration);
        const Vector3<T> gained = back * Vector3<T>(Map(v_j) - Map(v_i) - g * t);
        const Vector3<T> gone = back * Vector3<T>(Map(pose_j + 4) - Map(pose_i + 4) - Map(v_i) * t - g * (t * t * 0.5));
        Eigen::Matrix<T, 9, 1> error;
        error.template head<3>() = vector_of<T>(apart.conjugate() * said);
        error.template segment<3>(3) = velocity.cast<T>() + moved.template segment<3>(3) - gained;
        error.template tail<3>() = position.cast<T>() + moved.template tail<3>() - gone;
        Eigen::Map<Eigen::Matrix<T, 9, 1>> whitened(residual);
        whitened = whitening.cast<T>() * error;
        return true;
    }
};
