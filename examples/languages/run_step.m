% A table turns by 90 deg/s for a second: what heading does the generated MATLAB return?
addpath('out/matlab');
increment = 90 * pi / 180 * 0.01; % rad in a sample of 0.01 s
% Two increments a step, x, y, z of the first and of the second in rows; 50 steps.
samples = repmat([0, 0, increment; 0, 0, increment], 1, 1, 50);
history = euler_rk4_2_propagate([], samples); % a column for each state, from zero rotation on
state = euler_normalize(history(:, end));
fprintf('heading %.9f deg\n', 2 * atan2(state(3), state(4)) * 180 / pi);
